"""Where to look from: ascent of Q by the camera pose, through the renderer (Algorithm 1, lines 5-15).

A view is a place on the task's shell: azimuth, elevation, distance, the camera's top up and the target on its
axis. Eq. 25 is followed from a few starts, as Q has several hills: the present view and the best of a first
look over the shell. Line 10's test decides on every step before the camera moves, with the price of its
motion taken off Q, because a camera that is moved for each trial costs seconds. Only the direction of the
gradient is used, projected onto the region; the length of the step grows when it is accepted and halves when
it is not, or leads where the arm cannot go.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.inverse.target_renderer import TargetRenderer
from samrl_core.learn.sensing_value import Networks, SensingValue
from samrl_core.learn.views import camera_from
from samrl_core.model.model import CameraPose, Model
from samrl_core.real2sim import Estimate
from samrl_core.robots.geometry import Capsules
from samrl_core.robots.robot import CellSpec
from samrl_core.tasks.task import Task
from samrl_core.types.camera import Camera
from samrl_core.types.pose import look_at
from samrl_core.view_planning import ViewChoice
from samrl_core.view_reach import (
    ReachSettings,
    View,
    ViewReach,
    bounds_of,
    motion_seconds,
    place_of,
    place_position,
)


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
    through_action: bool = False  # see `SensingValue.q`
    min_gain: float = 0.02  # a view must be better than the present one by this, after its price [Q]
    time_price: float = 0.01  # of camera motion [Q/s]
    speed_share: float = 0.5  # of the joints' velocity limits, for the time of a motion
    finalists: int = 4  # ways to the best views that are checked for collisions


def place_camera(places: torch.Tensor, target: np.ndarray) -> CameraPose:
    """World-to-camera rotation (B, 3, 3) and translation (B, 3) [m] of places (B, 3), differentiable."""
    azimuth, elevation, distance = places.unbind(-1)
    return camera_from(azimuth, elevation, distance, torch.as_tensor(target, dtype=places.dtype))


@dataclass(frozen=True, eq=False)
class _Look:
    place: np.ndarray  # (3,)
    view: View
    q: float
    utility: float  # Q less the price of the motion
    slope: np.ndarray  # (3,) of Q by the place; zero where it was not asked for


class ViewAscent:
    """Chooses views of one cell and task by its networks."""

    def __init__(
        self,
        model: Model,
        cell: CellSpec,
        task: Task,
        networks: Networks,
        settings: ViewAscentSettings | None = None,
    ) -> None:
        """Builds the kinematic models."""
        self._model, self._cell, self._networks = model, cell, networks
        self._settings = settings or ViewAscentSettings()
        self._region = task.view_region()
        self._reach = ViewReach(cell, task, self._settings.reach)

    def prepare(self) -> None:
        """Solve the reachable views now (seconds) instead of in the first plan."""
        _ = self._reach.views

    def plan(
        self, estimate: Estimate, tool_arm_position: np.ndarray, camera_arm_position: np.ndarray
    ) -> ViewChoice:
        """Choose the next view.

        Renderings, all without moving: 1 + `first_looks` alone and `starts` (1 + `steps`) with gradient at
        most, as many passes of either network, and one of the renderer's depth for the visibility.

        Args:
            estimate: what is believed.
            tool_arm_position: where the tool arm will be when the image is taken (J,) [rad].
            camera_arm_position: where the camera arm is (J,) [rad].

        Raises:
            InputError: positions of wrong shape or not finite, or networks whose answer is not finite.
        """
        s = self._settings
        here = np.asarray(camera_arm_position, dtype=np.float64)
        value = SensingValue(self._model, self._networks, estimate, tool_arm_position)
        present_pose = self._reach.camera_at(here)
        with torch.no_grad():
            present = float(value.q(value.view(present_pose))[0])
        obstacles = Capsules.joined(
            (
                self._reach.tool_capsules(tool_arm_position, estimate.values),
                self._reach.body_capsules(estimate.values),
            )
        )
        climb = _Climb(self, value, here, obstacles)
        looks = climb.first_looks()
        places = [place_of(present_pose.position, self._region), *(look.place for look in looks)]
        climbed = climb.from_places(places[: s.starts])
        count = 1 + climb.renderings
        found = sorted([*looks, *climbed], key=lambda look: -look.utility)
        best = next(
            (
                look
                for look in found[: s.finalists]
                if look.utility > present + s.min_gain
                and self._reach.way_is_clear(here, look.view.joint_position, obstacles)
            ),
            None,
        )
        if best is None:
            gain = found[0].utility - present if found else 0.0
            reason = f"stays: of {count} views none that is free gains {s.min_gain:g}; the most is {gain:.3f}"
            pose, joints, q = present_pose, here, present
        else:
            pose, joints, q = best.view.camera_in_world, best.view.joint_position, best.q
            reason = f"the best of {count} views gains {best.utility - present:.3f} after the price of moving"
        renderer = TargetRenderer(self._model, Camera(self._cell.intrinsics, pose), tool_arm_position)
        visibility = renderer.visibility(estimate.values, estimate.colors)
        return ViewChoice(best is not None, pose, joints, q, present, visibility, count, reason)


class _Climb:
    """One plan's search; counts what it costs."""

    def __init__(
        self, ascent: ViewAscent, value: SensingValue, here: np.ndarray, obstacles: Capsules
    ) -> None:
        self._settings, self._region = ascent._settings, ascent._region
        self._reach, self._limits = ascent._reach, ascent._cell.camera_arm.limits
        self._value, self._here, self._obstacles = value, here, obstacles
        self._seeds = [here, ascent._cell.camera_arm.home]
        self._scale = np.array(self._settings.scale)
        self.renderings = 0

    def first_looks(self) -> list[_Look]:
        """Clear views of the grid, spread over it, the best first."""
        free = [v for v in self._reach.views if self._reach.is_clear(v.capsules, self._obstacles)]
        some = np.unique(
            np.linspace(0, len(free) - 1, min(len(free), self._settings.first_looks)).astype(int)
        )
        places = [place_of(free[i].camera_in_world.position, self._region) for i in some]
        looks = self._look(places, [free[i] for i in some], with_slope=False)
        return sorted(looks, key=lambda look: -look.utility)

    def from_places(self, places: list[np.ndarray]) -> list[_Look]:
        """Eq. 25 with line 10's test, from several places at once."""
        s = self._settings
        reached = [(place, view) for place in places if (view := self._reached(place)) is not None]
        best = self._look([p for p, _ in reached], [v for _, v in reached], with_slope=True)
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
            trials = self._look([p for p, _ in ahead], [v for _, v in ahead], with_slope=True)
            for k, trial in zip(who, trials, strict=True):
                accepted = trial.utility >= best[k].utility  # line 10
                best[k] = trial if accepted else best[k]
                length[k] *= 1.5 if accepted else 0.5
        return best

    def _ahead(self, look: _Look, length: float) -> np.ndarray | None:
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

    def _look(self, places: list[np.ndarray], views: list[View], with_slope: bool) -> list[_Look]:
        """All of them in one rendering."""
        if not places:
            return []
        self.renderings += len(places)
        variable = torch.from_numpy(np.stack(places)).requires_grad_(with_slope)
        with torch.set_grad_enabled(with_slope):
            image = self._value.image(place_camera(variable, self._region.target))
            q, _ = self._value.q(image, self._settings.through_action)
        slopes = np.zeros((len(places), 3))
        if with_slope:
            slopes = torch.autograd.grad(q.sum(), variable)[0].numpy()
        found = []
        for place, view, one, slope in zip(places, views, q.tolist(), slopes, strict=True):
            seconds = self._seconds(view)
            found.append(_Look(place, view, one, one - self._settings.time_price * seconds, slope))
        return found

    def _seconds(self, view: View) -> float:
        share = self._settings.speed_share
        return motion_seconds(self._here, view.joint_position, self._limits.velocity, share)
