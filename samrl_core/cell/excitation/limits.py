"""What a trajectory must keep to before it may be played."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.excitation.clearance import ArmLine
from samrl_core.cell.excitation.workspace import POSITION_MARGIN
from samrl_core.cell.robots.arm_model import Payload
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError, LimitError

VELOCITY_SHARE = 0.7  # of the arm's limit that a trajectory may use
ACCELERATION_SHARE = 0.7
EFFORT_SHARE = 0.7
_TORQUE_EVERY_S = 0.02  # chirps need it [s]
_CLEARANCE_EVERY_S = 0.08  # a few centimetres of travel, inside the margins of `clearance` [s]


def check_trajectory(spec: RobotSpec, payload: Payload | None, command: JointSignal) -> None:
    """Whether a commanded motion is safe to play.

    Raises:
        InputError: a quantity is missing, of the wrong shape or not finite, or the ends are not at rest.
        LimitError: position, velocity, acceleration or predicted torque of a joint beyond its share of the
            limit, or too near the table or the arm itself.
    """
    position, velocity, acceleration = _moving(spec, command)
    limits = spec.limits
    low, high = limits.lower + POSITION_MARGIN, limits.upper - POSITION_MARGIN
    for j, name in enumerate(spec.joint_names):
        least, most = position[:, j].min(), position[:, j].max()
        if least < low[j] or most > high[j]:
            raise LimitError(
                f"{name}: position {least:.3f} to {most:.3f} rad, allowed {low[j]:.3f} to {high[j]:.3f} rad; "
                "reduce the amplitude or move the poses"
            )
    period = float(np.median(np.diff(command.time)))
    rows = range(0, len(command), max(1, round(_TORQUE_EVERY_S / period)))
    line = ArmLine(spec, payload)
    effort = np.array([line.model.inverse_dynamics(position[k], velocity[k], acceleration[k]) for k in rows])
    for what, values, bound, share, unit in (
        ("velocity", velocity, limits.velocity, VELOCITY_SHARE, "rad/s"),
        ("acceleration", acceleration, limits.acceleration, ACCELERATION_SHARE, "rad/s2"),
        ("predicted torque", effort, limits.effort, EFFORT_SHARE, "N m"),
    ):
        most = np.abs(values).max(axis=0)
        j = int(np.argmax(most / bound))
        if most[j] > share * bound[j]:
            raise LimitError(
                f"{spec.joint_names[j]}: {what} {most[j]:.3f} {unit}, allowed {share * bound[j]:.3f} {unit} "
                f"({share:.0%} of the arm's limit); reduce amplitude, speed or band"
            )
    near = line.clearance(position[:: max(1, round(_CLEARANCE_EVERY_S / period))])
    for what, gap in (("the table", near.height), ("another part of the arm", near.self_distance)):
        if gap < 0.0:
            raise LimitError(
                f"'{spec.name}' comes {-gap:.3f} m too near to {what}; reduce the amplitude or move the poses"
            )


def _moving(spec: RobotSpec, command: JointSignal) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    shape = (len(command), len(spec.joint_names))
    found = []
    for what in ("position", "velocity", "acceleration"):
        values: np.ndarray | None = getattr(command, what)
        if values is None or values.shape != shape:
            raise InputError(
                f"trajectory needs {what} of shape {shape}, has {None if values is None else values.shape}"
            )
        if not np.isfinite(values).all():
            raise InputError(f"trajectory has {what} that is not finite")
        found.append(values)
    ends = np.abs(found[1][[0, -1]])
    if ends.max() > 1e-6:
        j = int(np.argmax(ends.max(axis=0)))
        raise InputError(
            f"{spec.joint_names[j]} starts or ends at {ends[:, j].max():.4f} rad/s; start and end at rest"
        )
    return found[0], found[1], found[2]
