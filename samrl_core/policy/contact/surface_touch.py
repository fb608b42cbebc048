"""How high the surface is that the work lies on: the tool comes down beside the work until it touches.

A camera that shows everything 3 mm too high and a table that is 3 mm too high make the same image. What an
action needs is the height of the edge over the surface, and that the joints tell to their encoders' precision
once the two touch: torques say when (as for a peg, `insertion`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import Observation
from samrl_core.policy.contact.tip_sense import TipSense

FEEL = "feel"  # name of the actions that come down


@dataclass(frozen=True)
class SurfaceSettings:
    """Steps and forces."""

    encoders: float = 0.001  # standard deviation of the tip's height by them [m]
    sure: float = 2.5  # so many standard deviations over where the surface is expected steps become slow
    slow_step: float = 0.001  # 2 mm in 0.1 s would hit it with 18 N [m]
    aligned: float = 0.004  # lateral distance from where it goes down [m]
    touch: float = 1.2  # vertical force that is a touch, of a tip that sinks no more [N]
    stops: float = 0.0005  # it sank by less since the last reading [m]
    slides: float = 0.003  # and went aside by less: what is moved level does not sink either [m]
    most_lift: float = 0.003  # of the command, which is below a touched surface [m]
    lowest: float = 5.0  # so many standard deviations below nothing is there to be touched


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
        self._lift = 0.0  # of the commanded tip, which is below the touched surface, up to it [m]
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
        """Take in a reading, once; the estimate (P,) says where the work lies, which pushes too, and how high
        the camera shows what lies on the surface.
        """
        if self.known or self._seen_ns == observation.stamp_ns:
            return
        s, self._seen_ns = self._settings, observation.stamp_ns
        reading = self._sense.read(observation.tool_arm)
        push, height = -float(reading.force[2]), float(reading.tip[2])
        slow, _ = self._expected(values)
        way, self._tip = reading.tip - self._tip, reading.tip
        if self._free is None or height > slow + s.slow_step:
            self._free = push if self._free is None else 0.5 * (self._free + push)
            return
        beside = reading.tip[0] < self._task.behind_x(values) + 0.5 * self._task.gap
        if push - self._free > s.touch:
            aside = float(np.linalg.norm(way[:2]))
            if beside and -way[2] < s.stops and aside < s.slides:
                self._touched = height
                give = float(reading.compliance[2, 2]) * (push - self._free)
                self._lift = min(give, s.most_lift)
        else:
            self._free += 0.3 * (push - self._free)

    def move(self, values: np.ndarray, tip: np.ndarray) -> np.ndarray | None:
        """The next action (3,) [m] of a tip (3,) [m] towards a touch, and that which ends pressing after it.

        None where the tip is not behind the work, and where nothing was touched: then the surface is taken to
        be as drawn.
        """
        if self._lift > 0.0:
            up, self._lift = np.array([0.0, 0.0, self._lift]), 0.0
            return up
        s, goals = self._settings, self._task.sub_goals(values, tip)
        slow, lowest = self._expected(values)
        if self.known or not goals or goals[0].name not in ("behind", "under") or tip[2] < lowest:
            return None
        place = goals[0].tip_position if goals[0].name == "behind" else tip
        way = np.array([*(place[:2] - tip[:2]), min(slow - tip[2], 0.0)])
        if tip[2] > slow + 0.5 * s.slow_step or float(np.linalg.norm(way[:2])) > s.aligned:
            return way * min(1.0, goals[0].max_step / max(float(np.linalg.norm(way)), 1e-12))
        return np.array([*way[:2], -s.slow_step])

    def _expected(self, values: np.ndarray) -> tuple[float, float]:
        """Heights of the tip [m] at which steps become slow, and below which there is no surface.

        What the camera shows too high is its own error and the surface's height: of the sum each is expected
        to have its share of the variance.
        """
        s, surface, camera = self._settings, self._task.surface_deviation, self._task.camera_deviation
        share = surface**2 / (surface**2 + camera**2)
        expected = share * float(self._task.camera_shift(values)[2])
        deviation = float(np.hypot(np.sqrt(share) * camera, s.encoders))
        return expected + s.sure * deviation, expected - s.lowest * deviation
