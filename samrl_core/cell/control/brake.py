"""How a set point comes to rest when commands are no longer to be followed."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.robot import JointLimits
from samrl_core.cell.types.observation import ArmCommand


def resting(position: np.ndarray, stamp_ns: int) -> ArmCommand:
    """The command to stay at a position (J,) [rad]."""
    zeros = np.zeros(len(position))
    return ArmCommand(stamp_ns, position, zeros, zeros, zeros)


def braked(present: ArmCommand, now_ns: int, limits: JointLimits, fraction: float) -> ArmCommand:
    """The set point at `now_ns`, each joint slowing down by itself with a constant deceleration.

    Trapezoidal in velocity: deceleration sets in at once (jerk is not limited, an arm must stop now) at
    `fraction` of the acceleration limit, or more, up to the whole limit, where a position limit is near.
    The feed-forward torque is zero: what it was meant for is no longer happening.
    """
    velocity = present.velocity
    if not velocity.any():
        return resting(present.position, now_ns)
    dt = max(0.0, (now_ns - present.stamp_ns) * 1e-9)
    speed, way = np.abs(velocity), np.sign(velocity)
    gap = np.where(way > 0, limits.upper - present.position, present.position - limits.lower)
    needed = 0.5 * speed * speed / np.maximum(gap, 1e-9)
    deceleration = np.minimum(np.maximum(fraction * limits.acceleration, needed), limits.acceleration)
    duration = np.minimum(dt, speed / deceleration)
    slower = np.where(speed > deceleration * dt, speed - deceleration * dt, 0.0)
    position = present.position + way * (speed - 0.5 * deceleration * duration) * duration
    # Joints that start beyond a limit may stay there but not go farther.
    low, high = np.minimum(limits.lower, present.position), np.maximum(limits.upper, present.position)
    acceleration = np.where(slower > 0.0, -way * deceleration, 0.0)
    position = np.clip(position, low, high)
    return ArmCommand(now_ns, position, way * slower, acceleration, np.zeros(len(position)))
