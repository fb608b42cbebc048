"""How high the surface is that the work lies on: the tool comes down beside the work until it touches.

A camera that shows everything 3 mm too high and a table that is 3 mm too high make the same image. What an
action needs is the height of the edge over the surface, and that the joints tell to their encoders' precision
once the two touch: the arm stops its guarded motion there (`TouchStop`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.control.tip_sense import TipSense
from samrl_core.cell.control.touch_stop import TOUCH_DOWN
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import Observation

LIFT = "lift"  # name of the action that ends pressing


@dataclass(frozen=True)
class SurfaceSettings:
    """Steps and forces."""

    encoders: float = 0.001  # standard deviation of the tip's height by them [m]
    aligned: float = 0.004  # lateral distance from where it goes down [m]
    step: float = 0.010  # of a guarded motion downwards [m]
    short: float = 0.0006  # one that ended so far before its end was stopped [m]
    slides: float = 0.0036  # if it went aside by less: what is moved level does not sink either [m]
    stays: float = 0.0005  # one that sank by less than that may not have been sent down at all [m]
    push: float = 2.5  # unless so much more pushes upwards than before; one reading scatters by 0.4 [N]
    lift: float = 0.001  # of the command, which a guarded motion leaves below the surface [m]
    lowest: float = 5.0  # so many standard deviations below nothing is there to be touched


@dataclass(frozen=True, eq=False)
class Approach:
    """The next action on the way to a touch."""

    name: str  # `TOUCH_DOWN`, `LIFT`, or the sub-goal "behind", above which it goes
    displacement: np.ndarray  # (3,) of the tip [m]


def felt_surface(task: Task) -> SpatulaFlipping | None:
    """The task, if what its parts lie on is of unknown height; else None."""
    return task if isinstance(task, SpatulaFlipping) and task.surface_deviation > 0.0 else None


class SurfaceTouch:
    """Its state: what is read in free space, and the height of the first touch of an episode.

    Args:
        task: whose edge and surface.
        cell: as calibrated.
        settings: of the search.
    """

    def __init__(
        self, task: SpatulaFlipping, cell: CellSpec, settings: SurfaceSettings | None = None
    ) -> None:
        self._task, self._settings = task, settings or SurfaceSettings()
        self._sense = TipSense(cell, task.scene(cell).tool)
        self.begin_episode()

    def begin_episode(self) -> None:
        """Another surface may lie there."""
        self._free: float | None = None  # vertical force that is read with nothing touched [N]
        self._touched: float | None = None  # height of the tip by the encoders [m]
        self._presses = False  # the commanded tip is below the touched surface
        self._tip = np.full(3, np.inf)  # at the last reading, by the encoders (3,) [m]
        self._seen_ns = -1  # stamp of the last reading [ns]

    @property
    def known(self) -> bool:
        """Whether it was touched."""
        return self._touched is not None

    @property
    def height(self) -> float:
        """Of the surface by the encoders over the drawn one; 0 before it was touched [m]."""
        return 0.0 if self._touched is None else self._touched - self._task.edge_height

    def see(self, observation: Observation, values: np.ndarray) -> None:
        """Take in a reading, once; the estimate (P,) says where the work lies, which pushes too.

        A guarded motion that sank by less than its step was stopped by a touch. Of one that began at the
        surface the push tells; a camera that moves meanwhile changes neither.
        """
        if self.known or self._seen_ns == observation.stamp_ns:
            return
        s, self._seen_ns = self._settings, observation.stamp_ns
        reading = self._sense.read(observation.tool_arm)
        push, way, self._tip = -float(reading.force[2]), reading.tip - self._tip, reading.tip
        if self._free is None or float(np.linalg.norm(way[:2])) > s.slides or -way[2] > s.step - s.short:
            self._free = push
            return
        rise = push - self._free
        beside = reading.tip[0] < self._task.behind_x(values) + 0.5 * self._task.gap
        if beside and (-way[2] > s.stays or rise > s.push):
            self._touched = float(reading.tip[2])
            self._presses = True

    def move(self, values: np.ndarray, tip: np.ndarray) -> Approach | None:
        """The next action of a tip (3,) [m] towards a touch, and that which ends pressing after it.

        None where the tip is not behind the work, and where nothing was touched: then the surface is taken to
        be as drawn.
        """
        s = self._settings
        if self._presses:
            self._presses = False
            return Approach(LIFT, np.array([0.0, 0.0, s.lift]))
        low = np.array([*tip[:2], min(tip[2], self._task.low)])
        goals = self._task.sub_goals(values, low)  # by where the tip will be, before the rim or not
        if (
            self.known
            or tip[2] < self._lowest(values)
            or not goals
            or goals[0].name not in ("behind", "under")
        ):
            return None
        aside = goals[0].tip_position[:2] - tip[:2] if goals[0].name == "behind" else np.zeros(2)
        length = float(np.linalg.norm(aside))
        if length > s.aligned:  # as high as it is: the surface may lie over where it is expected
            return Approach("behind", np.array([*aside, 0.0]) * min(1.0, goals[0].max_step / length))
        return Approach(TOUCH_DOWN, np.array([0.0, 0.0, -s.step]))

    def _lowest(self, values: np.ndarray) -> float:
        """Height of the tip [m] below which there is no surface.

        What the camera shows too high is its own error and the surface's height: of the sum each is expected
        to have its share of the variance.
        """
        s, surface, camera = self._settings, self._task.surface_deviation, self._task.camera_deviation
        share = surface**2 / (surface**2 + camera**2)
        expected = share * float(self._task.camera_shift(values)[2])
        return expected - s.lowest * float(np.hypot(np.sqrt(share) * camera, s.encoders))
