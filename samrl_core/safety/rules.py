"""Whether one command may be tracked at all."""

from __future__ import annotations

import numpy as np

from samrl_core.errors import InputError, LimitError
from samrl_core.robots.robot import JointLimits
from samrl_core.safety.settings import GuardSettings
from samrl_core.types.observation import ArmCommand, ArmReading


def check_values(
    command: ArmCommand, limits: JointLimits, names: tuple[str, ...], settings: GuardSettings
) -> None:
    """Sizes, finiteness, and the arm's limits on position, velocity, acceleration and feed-forward torque.

    Raises:
        InputError: wrong size or a value that is not finite.
        LimitError: beyond a limit.
    """
    for what in ("position", "velocity", "acceleration", "effort"):
        values = np.asarray(getattr(command, what))
        if values.shape != (len(names),):
            raise InputError(f"command has {values.size} values of {what} for {len(names)} joints")
        if not np.isfinite(values).all():
            j = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(f"command: {what} of {names[j]} is {values[j]}, must be finite")
    low = limits.lower + settings.position_margin_rad
    high = limits.upper - settings.position_margin_rad
    outside = np.maximum(low - command.position, command.position - high)
    if outside.max() > 1e-9:
        j = int(np.argmax(outside))
        raise LimitError(
            f"command: {names[j]} to {command.position[j]:.4f} rad, allowed {low[j]:.4f} to {high[j]:.4f} rad"
        )
    for what, values, bound, unit in (
        ("velocity", command.velocity, limits.velocity * settings.slack, "rad/s"),
        ("acceleration", command.acceleration, limits.acceleration * settings.slack, "rad/s2"),
        ("feed-forward torque", command.effort, limits.effort, "N m"),
    ):
        over = np.abs(values) / bound
        if over.max() > 1.0:
            j = int(np.argmax(over))
            raise LimitError(f"command: {what} of {names[j]} is {values[j]:.3f} {unit}, limit {bound[j]:.3f} {unit}")


def check_jump(
    command: ArmCommand, measured: ArmReading, names: tuple[str, ...], bound: float, remedy: str
) -> None:
    """Distance of a command from where the arm is measured.

    Raises:
        LimitError: too far.
    """
    jump = np.abs(command.position - measured.position)
    if jump.max() > bound:
        j = int(np.argmax(jump))
        raise LimitError(
            f"command: {names[j]} is {jump[j]:.3f} rad from its measured position, limit {bound} rad; {remedy}"
        )


def check_step(
    before: ArmCommand, command: ArmCommand, limits: JointLimits, names: tuple[str, ...], slack: float
) -> None:
    """Speed that two successive commands imply, whatever their velocity fields say.

    Raises:
        LimitError: faster than the velocity limit.
    """
    dt = (command.stamp_ns - before.stamp_ns) * 1e-9
    speed = np.abs(command.position - before.position) / dt
    over = speed / (limits.velocity * slack)
    if over.max() > 1.0:
        j = int(np.argmax(over))
        raise LimitError(
            f"command: {names[j]} moves {speed[j]:.3f} rad/s between two commands {dt * 1e3:.1f} ms apart, "
            f"limit {limits.velocity[j]:.3f} rad/s; smooth the trajectory"
        )
