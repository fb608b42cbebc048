"""The edge's way about the foot of the lip, from under the pancake until it has fallen over."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.task import SubGoal

_NEAR = 0.012  # from the arc, within which the edge is on it [m]
_REACHED = 0.002  # distance from a sub-goal [m]
_ROUNDED = 1e-6  # [rad]
_BEFORE = 0.004  # so far before the place where it begins too [m]


@dataclass(frozen=True)
class Arc:
    """A part of a circle in the plane y = const, from angle 0, on the table behind the lip, upwards."""

    foot: tuple[float, float]  # of the lip, x and z in world [m]
    begins: float  # so far before the lip [m]
    radius: float  # [m]
    end: float  # angle at which it ends [rad]
    step: float  # angle between two sub-goals at most [rad]
    push_step: float  # largest displacement per action [m]
    upright: tuple[float, float]  # angles between which the pancake stands by itself [rad]
    aside: float = 0.0  # the edge stays this far beside the pancake's middle, and follows it beyond [m]

    @property
    def step_across(self) -> float:
        """Displacement that goes through `upright` in one action from wherever its end comes next; 0 where
        nothing is to be crossed [m].
        """
        low, high = self.upright
        turn = high - low + 0.5 * self.step
        return 2.0 * self.radius * math.sin(0.5 * turn) + _REACHED if low < high else 0.0

    def goals(self, y: float) -> list[tuple[float, SubGoal]]:
        """Angles [rad] and sub-goals `turn_1`, `turn_2`, ... at a `y` [m].

        None lies within `upright`: a pancake that stands on its rim rolls off while somebody thinks. It is
        turned to where the blade still holds it, and in one action on to where it falls over.
        """
        low, high = self.upright
        count = math.ceil(self.end / self.step - 1e-9)
        found: list[tuple[float, SubGoal]] = []
        for k in range(1, count + 1):
            angle = self.end * k / count
            if low + _ROUNDED < angle < high - _ROUNDED:
                continue
            crosses = found and found[-1][0] < high - _ROUNDED <= angle
            offset = self.radius * np.array([-math.cos(angle), math.sin(angle)])
            place = np.array([self.foot[0] + offset[0], y, self.foot[1] + offset[1]])
            step = max(self.push_step, self.step_across) if crosses else self.push_step
            found.append((angle, SubGoal(f"turn_{k}", place, _REACHED, step)))
        return found

    def left(self, y: float, tip: np.ndarray) -> tuple[SubGoal, ...]:
        """Those ahead of a tip (3,) [m]; none where it is not on the arc, or at its end.

        A pancake that leans on a blade slides along with it sideways, and farther: who follows it chases it.
        The first is at least half a step away, or noise would hold the tip where it is.
        """
        along, up = self.foot[0] - float(tip[0]), float(tip[2]) - self.foot[1]
        angle, radius = math.atan2(up, along), math.hypot(along, up)
        if abs(radius - self.radius) > _NEAR or along > self.begins + _BEFORE or angle > self.end:
            return ()
        beside = min(max(float(tip[1]), y - self.aside), y + self.aside)
        return tuple(goal for phi, goal in self.goals(beside) if phi > angle + 0.5 * self.step)
