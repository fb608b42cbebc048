"""Search for the next view: gradient ascent of Q over camera poses (Algorithm 1, lines 5-15).

A viewpoint is a point on the task's view region: azimuth [rad], elevation [rad] and distance [m] of the
camera, whose top is up and whose optical axis meets the target. Q has several local maxima, so eq. 25 is
followed from a few starts: the present view and the best views of the grid. Line 10's test decides on every
step before the camera moves, with a penalty for the motion subtracted from Q, because moving the camera for
each trial would cost seconds. Only the direction of the gradient is used, projected onto the region. The step
grows when it is accepted and halves when it is rejected or leads where the arm cannot go.

The search is a generator: it yields viewpoints and receives their Q and gradients. So the caller can render
one search or many of them in one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice

import numpy as np
import torch

from samrl_core.cell.robots.geometry import Capsules
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import ViewRegion
from samrl_core.cell.types.pose import look_at
from samrl_core.model.model import CameraPose
from samrl_core.policy.view.view_reach import (
    SPEED_SHARE,
    ReachSettings,
    View,
    ViewReach,
    bounds_of,
    motion_seconds,
    viewpoint_of,
    viewpoint_position,
)
from samrl_core.policy.view.views import camera_from


@dataclass(frozen=True)
class ViewAscentSettings:
    """Size of the search and penalty for moving the camera."""

    reach: ReachSettings = ReachSettings()
    initial_views: int = 16  # reachable views scored before the ascent, spread over the view region
    starts: int = 3  # of the ascent: the present view, and the best of the initial ones
    steps: int = 5  # trials from each start
    first_step: float = 0.2  # [scale]
    smallest_step: float = 0.02  # [scale]
    # Steps that move the camera about as far [rad], [rad], [m].
    scale: tuple[float, float, float] = (1.0, 1.0, 0.4)
    through_action: bool = False  # see `sensing_value.value_of`
    min_gain: float = 0.02  # least gain over the present view, the motion's penalty subtracted [Q]
    time_penalty: float = 0.01  # of camera motion [Q/s]
    speed_share: float = SPEED_SHARE  # of the joints' velocity limits, for the time of a motion
    finalists: int = 4  # best views whose paths are checked for collisions
    # Share of the target's surface towards the camera that a view must show, 0..1. Q knows the state of the
    # model as if it were true, and so prefers views that serve the action; an update needs to see the target.
    least_visibility: float = 0.5


def camera_poses(viewpoints: torch.Tensor, target: np.ndarray) -> CameraPose:
    """World-to-camera rotation (B, 3, 3) and translation (B, 3) [m] at viewpoints (B, 3), differentiable."""
    azimuth, elevation, distance = viewpoints.unbind(-1)
    point = torch.as_tensor(target, dtype=viewpoints.dtype, device=viewpoints.device)
    return camera_from(azimuth, elevation, distance, point)


def spread(views: Sequence[View], count: int) -> list[View]:
    """At most `count` of them, evenly over their order."""
    some = np.unique(np.linspace(0, len(views) - 1, min(len(views), count)).astype(int))
    return [views[i] for i in some]


@dataclass(frozen=True, eq=False)
class Request:
    """Viewpoints whose Q a search asks for."""

    viewpoints: np.ndarray  # (N, 3)
    with_gradient: bool


@dataclass(frozen=True, eq=False)
class Answer:
    """Q of the viewpoints of a request."""

    q: np.ndarray  # (N,)
    gradients: np.ndarray  # (N, 3) dQ/dviewpoint; zero where it was not asked for


@dataclass(frozen=True, eq=False)
class ScoredView:
    """A viewpoint with its Q."""

    viewpoint: np.ndarray  # (3,)
    view: View
    q: float
    utility: float  # Q less the penalty of the motion
    gradient: np.ndarray  # (3,) dQ/dviewpoint; zero where it was not asked for


@dataclass(frozen=True, eq=False)
class SearchResult:
    """How a search ended."""

    moves: tuple[ScoredView, ...]  # the best view, if its gain is enough and the path to it clear; else none
    largest_gain: float  # of all scored views over the present one, less the penalty [Q]
    views: int  # that were scored, the present one included
    scored_views: tuple[ScoredView, ...]  # all scored views but the present one, in their order


Scoring = Generator[Request, Answer, list[ScoredView]]


class ViewSearch:
    """One search; see `run`."""

    def __init__(
        self,
        cell: CellSpec,
        region: ViewRegion,
        reach: ViewReach,
        settings: ViewAscentSettings,
        here: np.ndarray,
        obstacles: Capsules,
    ) -> None:
        """Args: as `ViewAscent` has them; `here` (J,) [rad] is where the camera arm is."""
        self._settings, self._region, self._reach = settings, region, reach
        self._velocity = cell.camera_arm.limits.velocity
        self._here, self._obstacles = here, obstacles
        self._seeds = [here, cell.camera_arm.home]
        self._scale = np.array(settings.scale)
        self._scored: list[ScoredView] = []

    def run(
        self,
        present: float,
        present_visibility: float = 1.0,
        visibility: Callable[[ScoredView], float] = lambda scored: 1.0,
    ) -> Generator[Request, Answer, SearchResult]:
        """Yields requests for Q; returns the best view.

        A view that shows too little of the target is not taken, and the present one is worth nothing if it
        does. Where no other view shows enough, those are taken that show no less than the present one.

        Args:
            present: Q of the present view.
            present_visibility: share of the target that it shows, see `least_visibility`.
            visibility: the same of a scored view; called for the best ones until enough of them are good.
        """
        s = self._settings
        scored_views = yield from self._score_grid()
        start = self._reach.camera_at(self._here).position
        viewpoints = [viewpoint_of(start, self._region), *(scored.viewpoint for scored in scored_views)]
        climbed = yield from self._ascend(viewpoints[: s.starts])
        found = sorted([*scored_views, *climbed], key=lambda scored: -scored.utility)
        shown = cache(visibility)
        worth = present if present_visibility >= s.least_visibility else 0.0
        best = self._best(found, worth, lambda scored: shown(scored) >= s.least_visibility)
        if best is None:
            best = self._best(found, present, lambda scored: shown(scored) >= present_visibility)
        largest_gain = found[0].utility - present if found else 0.0
        scored_views = tuple(self._scored)
        return SearchResult(
            () if best is None else (best,), largest_gain, 1 + len(scored_views), scored_views
        )

    def _best(
        self, found: Sequence[ScoredView], worth: float, shows: Callable[[ScoredView], bool]
    ) -> ScoredView | None:
        """The first that gains enough over `worth`, shows the target, and has a clear way to it."""
        s = self._settings
        gaining = (scored for scored in found if scored.utility > worth + s.min_gain)
        good = islice(filter(shows, gaining), s.finalists)
        clear = self._reach.way_is_clear
        return next(
            (scored for scored in good if clear(self._here, scored.view.joint_position, self._obstacles)),
            None,
        )

    def _score_grid(self) -> Scoring:
        """Scores clear views of the grid, spread over it; the best first."""
        free = self._reach.clear_views(self._obstacles)
        some = spread(free, self._settings.initial_views)
        viewpoints = [viewpoint_of(view.camera_in_world.position, self._region) for view in some]
        scored_views = yield from self._score_views(viewpoints, some, with_gradient=False)
        return sorted(scored_views, key=lambda scored: -scored.utility)

    def _ascend(self, viewpoints: list[np.ndarray]) -> Scoring:
        """Eq. 25 with line 10's test, from several viewpoints at once."""
        s = self._settings
        reached = [
            (viewpoint, view) for viewpoint in viewpoints if (view := self._solve_view(viewpoint)) is not None
        ]
        best = yield from self._score_views(
            [p for p, _ in reached], [v for _, v in reached], with_gradient=True
        )
        length = np.full(len(best), s.first_step)
        for _ in range(s.steps):
            who: list[int] = []
            ahead: list[tuple[np.ndarray, View]] = []
            for k, scored in enumerate(best):
                while length[k] >= s.smallest_step:
                    viewpoint = self._ahead(scored, length[k])
                    if viewpoint is None:
                        length[k] = 0.0  # a stationary point of the region
                        break
                    view = self._solve_view(viewpoint)
                    if view is not None:
                        who.append(k)
                        ahead.append((viewpoint, view))
                        break
                    length[k] *= 0.5
            if not who:
                break
            trials = yield from self._score_views(
                [p for p, _ in ahead], [v for _, v in ahead], with_gradient=True
            )
            for k, trial in zip(who, trials, strict=True):
                accepted = trial.utility >= best[k].utility  # line 10
                best[k] = trial if accepted else best[k]
                length[k] *= 1.5 if accepted else 0.5
        return best

    def _ahead(self, scored: ScoredView, length: float) -> np.ndarray | None:
        """One step up, within the region; None where no step within it leads up."""
        lower, upper = bounds_of(self._region)
        uphill = scored.gradient * self._scale
        blocked = ((scored.viewpoint <= lower) & (uphill < 0)) | ((scored.viewpoint >= upper) & (uphill > 0))
        uphill = np.where(blocked, 0.0, uphill)
        norm = float(np.linalg.norm(uphill))
        if norm < 1e-12:
            return None
        return np.clip(scored.viewpoint + length * self._scale * uphill / norm, lower, upper)

    def _solve_view(self, viewpoint: np.ndarray) -> View | None:
        eye = viewpoint_position(viewpoint, self._region)
        rolls = [look_at(eye, self._region.target, roll) for roll in self._reach.settings.rolls]
        return self._reach.solve_view(rolls, self._obstacles, self._here, self._seeds)

    def _score_views(self, viewpoints: list[np.ndarray], views: list[View], with_gradient: bool) -> Scoring:
        """Scores all of them in one request."""
        if not viewpoints:
            return []
        answer = yield Request(np.stack(viewpoints), with_gradient)
        found = []
        for viewpoint, view, q, gradient in zip(
            viewpoints, views, answer.q.tolist(), answer.gradients, strict=True
        ):
            share = self._settings.speed_share
            seconds = motion_seconds(self._here, view.joint_position, self._velocity, share)
            found.append(ScoredView(viewpoint, view, q, q - self._settings.time_penalty * seconds, gradient))
        self._scored += found
        return found
