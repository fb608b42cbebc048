"""Friction that holds a joint at rest: an event at zero velocity, not a smoothed sign.

In each step a joint stops if less torque than its level does that, else it is opposed with its level. Joints
that move one another are asked in turn until none changes (Karnopp 1985, with the coupling of the bodies).
"""

from __future__ import annotations

import math

import numpy as np

_TURNS, _SAME = 200, 1e-9  # [N m]


class DryFriction:
    """Of one recording; remembers what held the joints in the step before."""

    def __init__(self, levels: np.ndarray) -> None:
        """Levels (J,) [N m]; (0,) where nothing sticks."""
        self.levels: list[float] = levels.tolist()
        self.torque = [0.0] * len(self.levels)

    def __bool__(self) -> bool:
        return any(self.levels)

    def stop(self, joint: int, push: float) -> float:
        """What is left of a torque that would move a joint alone [N m]."""
        level = self.levels[joint]
        self.torque[joint] = min(max(push, -level), level)
        return push - self.torque[joint]

    def stop_together(self, joints: list[int], free: np.ndarray, yielding: np.ndarray) -> np.ndarray:
        """Torques (n,) that stop or oppose joints which move one another.

        Args:
            joints: n of them.
            free: velocities (n,) at the step's end without friction.
            yielding: (n, n) velocity that a torque takes off.
        """
        held = np.array([self.torque[i] for i in joints])
        level = np.array([self.levels[i] for i in joints])
        held = np.clip(held, -level, level)
        for _ in range(_TURNS):
            before = held.copy()
            for k in range(len(joints)):
                speed = float(free[k] - yielding[k] @ held)
                push = held[k] + speed / yielding[k, k]
                held[k] = math.copysign(min(abs(push), level[k]), push)
            if np.abs(held - before).max(initial=0.0) < _SAME:
                break
        for i, torque in zip(joints, held.tolist(), strict=True):
            self.torque[i] = torque
        return held
