"""The joint impedance controller that every arm of the cell runs at 1 kHz."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.robot import ImpedanceGains, JointLimits
from samrl_core.cell.types.observation import ArmCommand


def impedance_effort(
    controller: ImpedanceGains,
    limits: JointLimits,
    command: ArmCommand,
    position: np.ndarray,
    velocity: np.ndarray,
    gravity_effort: np.ndarray,
) -> np.ndarray:
    """effort = clip(K (q_d - q) + D (dq_d - dq) + g(q) + feed-forward), clipped to the effort limits.

    Args:
        controller: stiffness K and damping D, per joint.
        limits: `effort` bounds the result on both sides.
        command: q_d, dq_d and the feed-forward torque; its acceleration is not used by this law.
        position: measured q (J,) [rad].
        velocity: measured dq (J,) [rad/s].
        gravity_effort: nominal g(q) with payload (J,) [N m].

    Returns:
        Torque to the drives (J,) [N m].
    """
    effort = (
        controller.stiffness * (command.position - position)
        + controller.damping * (command.velocity - velocity)
        + gravity_effort
        + command.effort
    )
    return np.minimum(np.maximum(effort, -limits.effort), limits.effort)
