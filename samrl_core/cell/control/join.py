"""How a set point gets onto the commanded curve when it is not on it, as at a start."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.control.guard_settings import GuardSettings
from samrl_core.cell.robots.robot import JointLimits
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.common.errors import LimitError

_EXACT = 1e-9  # [rad], [rad/s]: already on the curve


class Join:
    """The distance between set point and curve, led to zero by a cubic that ends at rest.

    With d and v the distance and its rate at the start and T the duration, acceleration is at most
    6|d|/T^2 + 4|v|/T and speed beyond the curve's at most 1.5|d|/T + |v|/3. T is the shortest for which both
    are within `join_fraction` of the limits, which is why commands are held to the rest meanwhile.

    Raises:
        LimitError: the set point is too far from the curve, or too different in velocity.
    """

    def __init__(
        self,
        present: ArmCommand,
        curve: ArmCommand,
        limits: JointLimits,
        names: tuple[str, ...],
        s: GuardSettings,
    ) -> None:
        self._d = present.position - curve.position
        self._v = present.velocity - curve.velocity
        self.start_ns = self.end_ns = present.stamp_ns
        d, v = np.abs(self._d), np.abs(self._v)
        if d.max() < _EXACT and v.max() < _EXACT:
            return
        speed, acceleration = s.join_fraction * limits.velocity, s.join_fraction * limits.acceleration
        room = speed - v / 3.0
        by_acceleration = (4.0 * v + np.sqrt(16.0 * v * v + 24.0 * acceleration * d)) / (2.0 * acceleration)
        by_speed = np.where(room > 0.0, 1.5 * d / np.maximum(room, 1e-12), math.inf)
        needed = np.maximum(by_acceleration, by_speed)
        j = int(np.argmax(needed))
        if needed[j] > s.join_s:
            raise LimitError(
                f"command: {names[j]} is {d[j]:.4f} rad and {v[j]:.3f} rad/s from the set point, too much to "
                f"join it within {s.join_s} s; start at rest from the measured position"
            )
        self.end_ns = self.start_ns + math.ceil(float(needed[j]) * 1e9)

    def applied(self, curve: ArmCommand) -> ArmCommand:
        """The curve's point with what is left of the distance added."""
        if curve.stamp_ns >= self.end_ns:
            return curve
        duration = (self.end_ns - self.start_ns) * 1e-9
        s = (curve.stamp_ns - self.start_ns) / (self.end_ns - self.start_ns)
        r, d, v = 1.0 - s, self._d, self._v
        return ArmCommand(
            curve.stamp_ns,
            curve.position + r * r * (1 + 2 * s) * d + s * r * r * duration * v,
            curve.velocity - 6 * s * r / duration * d + r * (1 - 3 * s) * v,
            curve.acceleration + (12 * s - 6) / duration**2 * d + (6 * s - 4) / duration * v,
            curve.effort,
        )
