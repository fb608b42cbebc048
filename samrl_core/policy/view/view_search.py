"""The search for a view: what is looked at next, given Q of what was looked at (Algorithm 1, lines 5-15).

A view is a place on the task's shell: azimuth, elevation, distance, the camera's top up and the target on its
axis. Eq. 25 is followed from a few starts, as Q has several hills: the present view and the best of a first
look over the shell. Line 10's test decides on every step before the camera moves, with the price of its
motion taken off Q, because a camera that is moved for each trial costs seconds. Only the direction of the
gradient is used, projected onto the region; the length of the step grows when it is accepted and halves when
it is not, or leads where the arm cannot go.

Who draws the images is left open: a search asks for Q of places and is told, so that one state or many
searches side by side can be drawn at a time.
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
    ReachSettings,
    View,
    ViewReach,
    bounds_of,
    motion_seconds,
    place_of,
    place_position,
)
from samrl_core.policy.view.views import camera_from


@dataclass(frozen=True)
class ViewAscentSettings:
    """How far is looked around, how far is climbed, and what moving costs."""

    reach: ReachSettings = ReachSettings()
    first_looks: int = 16  # reachable views rendered before the ascent, spread over the shell
    starts: int = 3  # of the ascent: the present view, and the best of the first looks
    steps: int = 5  # trials from each start
    first_step: float = 0.2  # [scale]
    smallest_step: float = 0.02  # [scale]
    scale: tuple[float, float, float] = (1.0, 1.0, 0.4)  # like ways of the camera [rad], [rad], [m]
    through_action: bool = False  # see `sensing_value.value_of`
    min_gain: float = 0.02  # a view must be better than the present one by this, after its price [Q]
    time_price: float = 0.01  # of camera motion [Q/s]
    speed_share: float = 0.5  # of the joints' velocity limits, for the time of a motion
    finalists: int = 4  # ways to the best views that are checked for collisions
    # Share of the target's surface towards the camera that a view must show, 0..1. Q knows the state of the
    # model as if it were true, and so prefers views that serve the action; an update needs to see the target.
    least_visibility: float = 0.5


def place_camera(places: torch.Tensor, target: np.ndarray) -> CameraPose:
    """World-to-camera rotation (B, 3, 3) and translation (B, 3) [m] of places (B, 3), differentiable."""
    azimuth, elevation, distance = places.unbind(-1)
    point = torch.as_tensor(target, dtype=places.dtype, device=places.device)
    return camera_from(azimuth, elevation, distance, point)


def spread(views: Sequence[View], count: int) -> list[View]:
    """At most `count` of them, evenly over their order."""
    some = np.unique(np.linspace(0, len(views) - 1, min(len(views), count)).astype(int))
    return [views[i] for i in some]


@dataclass(frozen=True, eq=False)
class Request:
    """Places whose Q a search asks for."""

    places: np.ndarray  # (N, 3)
    with_slope: bool


@dataclass(frozen=True, eq=False)
class Answer:
    """Q of the places of a request."""

    q: np.ndarray  # (N,)
    slopes: np.ndarray  # (N, 3) of Q by the place; zero where they were not asked for


@dataclass(frozen=True, eq=False)
class Look:
    """A place that was looked at."""

    place: np.ndarray  # (3,)
    view: View
    q: float
    utility: float  # Q less the price of the motion
    slope: np.ndarray  # (3,) of Q by the place; zero where it was not asked for


@dataclass(frozen=True, eq=False)
class Found:
    """How a search ended."""

    moves: tuple[Look, ...]  # the best view, if it gains enough and the way to it is clear; else none
    most: float  # highest gain of all looks over the present view, less the price [Q]
    views: int  # looked at, the present one included
    looks: tuple[Look, ...]  # all of them but the present one, in their order


Asking = Generator[Request, Answer, list[Look]]


class ViewSearch:
    """One search; see `found`."""

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
        self._looks: list[Look] = []

    def found(
        self,
        present: float,
        present_visibility: float = 1.0,
        visibility: Callable[[Look], float] = lambda look: 1.0,
    ) -> Generator[Request, Answer, Found]:
        """Ask for what is to be looked at; the end is what was found.

        A view that shows too little of the target is not taken, and the present one is worth nothing if it
        does. Where no other view shows enough, those are taken that show no less than the present one.

        Args:
            present: Q of the present view.
            present_visibility: share of the target that it shows, see `least_visibility`.
            visibility: the same of a look; asked of the best ones until enough of them are good.
        """
        s = self._settings
        looks = yield from self._first_looks()
        start = self._reach.camera_at(self._here).position
        places = [place_of(start, self._region), *(look.place for look in looks)]
        climbed = yield from self._from_places(places[: s.starts])
        found = sorted([*looks, *climbed], key=lambda look: -look.utility)
        shown = cache(visibility)
        worth = present if present_visibility >= s.least_visibility else 0.0
        best = self._best(found, worth, lambda look: shown(look) >= s.least_visibility)
        if best is None:
            best = self._best(found, present, lambda look: shown(look) >= present_visibility)
        most = found[0].utility - present if found else 0.0
        looks = tuple(self._looks)
        return Found(() if best is None else (best,), most, 1 + len(looks), looks)

    def _best(self, found: Sequence[Look], worth: float, shows: Callable[[Look], bool]) -> Look | None:
        """The first that gains enough over `worth`, shows the target, and has a clear way to it."""
        s = self._settings
        gaining = (look for look in found if look.utility > worth + s.min_gain)
        good = islice(filter(shows, gaining), s.finalists)
        clear = self._reach.way_is_clear
        return next(
            (look for look in good if clear(self._here, look.view.joint_position, self._obstacles)), None
        )

    def _first_looks(self) -> Asking:
        """Clear views of the grid, spread over it, the best first."""
        free = self._reach.clear_views(self._obstacles)
        some = spread(free, self._settings.first_looks)
        places = [place_of(view.camera_in_world.position, self._region) for view in some]
        looks = yield from self._look(places, some, with_slope=False)
        return sorted(looks, key=lambda look: -look.utility)

    def _from_places(self, places: list[np.ndarray]) -> Asking:
        """Eq. 25 with line 10's test, from several places at once."""
        s = self._settings
        reached = [(place, view) for place in places if (view := self._reached(place)) is not None]
        best = yield from self._look([p for p, _ in reached], [v for _, v in reached], with_slope=True)
        length = np.full(len(best), s.first_step)
        for _ in range(s.steps):
            who: list[int] = []
            ahead: list[tuple[np.ndarray, View]] = []
            for k, look in enumerate(best):
                while length[k] >= s.smallest_step:
                    place = self._ahead(look, length[k])
                    if place is None:
                        length[k] = 0.0  # a stationary point of the region
                        break
                    view = self._reached(place)
                    if view is not None:
                        who.append(k)
                        ahead.append((place, view))
                        break
                    length[k] *= 0.5
            if not who:
                break
            trials = yield from self._look([p for p, _ in ahead], [v for _, v in ahead], with_slope=True)
            for k, trial in zip(who, trials, strict=True):
                accepted = trial.utility >= best[k].utility  # line 10
                best[k] = trial if accepted else best[k]
                length[k] *= 1.5 if accepted else 0.5
        return best

    def _ahead(self, look: Look, length: float) -> np.ndarray | None:
        """One step up, within the region; None where no step within it leads up."""
        lower, upper = bounds_of(self._region)
        uphill = look.slope * self._scale
        blocked = ((look.place <= lower) & (uphill < 0)) | ((look.place >= upper) & (uphill > 0))
        uphill = np.where(blocked, 0.0, uphill)
        norm = float(np.linalg.norm(uphill))
        if norm < 1e-12:
            return None
        return np.clip(look.place + length * self._scale * uphill / norm, lower, upper)

    def _reached(self, place: np.ndarray) -> View | None:
        eye = place_position(place, self._region)
        rolls = [look_at(eye, self._region.target, roll) for roll in self._reach.settings.rolls]
        return self._reach.reached(rolls, self._obstacles, self._here, self._seeds)

    def _look(self, places: list[np.ndarray], views: list[View], with_slope: bool) -> Asking:
        """All of them in one request."""
        if not places:
            return []
        answer = yield Request(np.stack(places), with_slope)
        found = []
        for place, view, q, slope in zip(places, views, answer.q.tolist(), answer.slopes, strict=True):
            share = self._settings.speed_share
            seconds = motion_seconds(self._here, view.joint_position, self._velocity, share)
            found.append(Look(place, view, q, q - self._settings.time_price * seconds, slope))
        self._looks += found
        return found
