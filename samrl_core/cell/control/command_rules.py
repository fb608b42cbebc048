"""Whether one command may be tracked at all. Comparisons are written so that NaN is refused, never passed."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.control.guard_settings import GuardSettings
from samrl_core.cell.robots.robot import JointLimits
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_core.common.errors import InputError, LimitError


def check_values(
    command: ArmCommand,
    limits: JointLimits,
    names: tuple[str, ...],
    settings: GuardSettings,
    share: float = 1.0,
) -> None:
    """Sizes, finiteness, and the arm's limits; `share` of those on velocity and acceleration.

    A position limit also counts for where the arm could come to rest at its full deceleration.

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
    stopped = command.position + 0.5 * command.velocity * np.abs(command.velocity) / limits.acceleration
    for what, values, slack in (("", command.position, 1e-9), (" cannot stop before", stopped, 1e-3)):
        outside = np.maximum(low - values, values - high)
        if outside.max() > slack:
            j = int(np.argmax(outside))
            raise LimitError(
                f"command: {names[j]}{what or ' to'} {values[j]:.4f} rad, allowed {low[j]:.4f} to "
                f"{high[j]:.4f} rad; keep the motion inside"
            )
    moving = share * settings.slack
    for what, values, bound, unit in (
        ("velocity", command.velocity, limits.velocity * moving, "rad/s"),
        ("acceleration", command.acceleration, limits.acceleration * moving, "rad/s2"),
        ("feed-forward torque", command.effort, limits.effort, "N m"),
    ):
        over = np.abs(values) / bound
        if over.max() > 1.0:
            j = int(np.argmax(over))
            joining = f" ({share:.0%} while the set point joins the commands)" if share < 1.0 else ""
            raise LimitError(
                f"command: {what} of {names[j]} is {values[j]:.3f} {unit}, limit {bound[j]:.3f} "
                f"{unit}{joining}; scale the motion down"
            )


def check_jump(
    command: ArmCommand, measured: ArmReading, names: tuple[str, ...], bound: float, remedy: str
) -> None:
    """Distance of a command from where the arm is measured.

    Raises:
        InputError: the measured position is of the wrong size or not finite.
        LimitError: too far.
    """
    if measured.position.shape != (len(names),) or not np.isfinite(measured.position).all():
        raise InputError(
            f"measured position {measured.position} must be {len(names)} finite numbers; check the driver"
        )
    jump = np.abs(command.position - measured.position)
    if jump.max() > bound:
        j = int(np.argmax(jump))
        raise LimitError(
            f"command: {names[j]} is {jump[j]:.3f} rad from its measured position, limit {bound} rad; "
            f"{remedy}"
        )


def check_step(
    before: ArmCommand,
    command: ArmCommand,
    limits: JointLimits,
    names: tuple[str, ...],
    settings: GuardSettings,
    share: float = 1.0,
) -> None:
    """Whether the cubic from one command to the next keeps the limits, whatever their fields say.

    That cubic is what is driven. Over a time h its acceleration is greatest at an end, |v1 - v0| / h +
    6 |p1 - p0 - h (v0 + v1) / 2| / h^2, and `share` of the acceleration limit holds for it. A sender that
    switches between full accelerations from one command to the next would be driven at 1.5 times of them,
    and is refused. The cubic's speed is held to the velocity limit. Stamps may be rounded, but jitter in
    them is a change of speed, and no margin is given for it.

    Raises:
        LimitError: faster than the velocity or acceleration limit.
    """
    h = (command.stamp_ns - before.stamp_ns) * 1e-9
    v0, v1 = before.velocity, command.velocity
    travel = command.position - before.position
    middle = 1.5 * travel / h - 0.25 * (v0 + v1)  # speed of the cubic half way
    peak = np.maximum(np.abs(travel) / h, np.abs(middle)) / (limits.velocity * settings.curve_slack)
    allowed = share * limits.acceleration * settings.slack * (1.0 + settings.stamp_resolution_s / h)
    change = np.abs(v1 - v0) / h / allowed
    untrue = np.maximum(np.abs(v0), np.abs(v1)) * settings.stamp_resolution_s + 1e-6  # [rad], with rounding
    bend = change + 6.0 * np.maximum(np.abs(travel - 0.5 * h * (v0 + v1)) - untrue, 0.0) / (h * h) / allowed
    for what, over, remedy in (
        ("position step", peak, "its velocity limit; smooth the trajectory"),
        ("velocity step", change, "its acceleration limit; smooth the trajectory"),
        ("position step", bend, "what its velocities allow; make the fields consistent"),
    ):
        if over.max() > 1.0:
            j = int(np.argmax(over))
            raise LimitError(
                f"command: {what} of {names[j]} ({travel[j]:.5f} rad, {v0[j]:.3f} to {v1[j]:.3f} rad/s in "
                f"{h * 1e3:.1f} ms) is {over[j]:.2f} times {remedy}"
            )
