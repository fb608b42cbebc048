"""When a trajectory is refused: the rules of ros2_controllers' JointTrajectoryController, plus our limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.robot import JointLimits
from samrl_core.common.errors import InputError, LimitError


@dataclass(frozen=True, eq=False)
class TrajectoryPoint:
    """One point. Velocity and acceleration may have length zero: not given."""

    position: np.ndarray  # (J,) [rad]
    velocity: np.ndarray  # (J,) or (0,) [rad/s]
    acceleration: np.ndarray  # (J,) or (0,) [rad/s2]
    time_from_start_ns: int


@dataclass(frozen=True)
class TrajectoryRules:
    """Settings, named as in ros2_controllers where it has them."""

    allow_nonzero_velocity_at_trajectory_end: bool = False
    stopped_velocity_tolerance: float = 1e-3  # counts as zero velocity at the end [rad/s]
    start_jump_rad: float = 0.2  # farthest first point from where the arm is [rad]
    joint_limit_margin: float = 0.0  # kept from position limits [rad]


def check_trajectory(
    joint_names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    *,
    expected_names: tuple[str, ...],
    limits: JointLimits,
    now_ns: int,
    stamp_ns: int,
    present_position: np.ndarray,
    rules: TrajectoryRules | None = None,
) -> list[TrajectoryPoint]:
    """The points in the arm's joint order, if no rule refuses them.

    Args:
        joint_names: as given with the points; any order.
        points: of the trajectory.
        expected_names: the arm's joints in order.
        limits: of the arm.
        now_ns: robot time [ns].
        stamp_ns: start of the trajectory, 0 for now [ns].
        present_position: where the set point is (J,) [rad].
        rules: settings.

    Raises:
        InputError: names, sizes, times or numbers that are wrong.
        LimitError: position, velocity or acceleration beyond a limit, or a jump at the start.
    """
    r = rules or TrajectoryRules()
    order = _order(list(joint_names), expected_names)
    if present_position.shape != (len(order),) or not np.isfinite(present_position).all():
        raise InputError(f"present position {present_position} must be {len(order)} finite numbers")
    if not points:
        raise InputError("trajectory has no points")
    checked = [_reordered(k, p, order) for k, p in enumerate(points)]
    times = [p.time_from_start_ns for p in checked]
    for k, (a, b) in enumerate(zip(times, times[1:], strict=False)):
        if b <= a:
            raise InputError(
                f"times must strictly increase: point {k} at {a * 1e-9:g} s, next {b * 1e-9:g} s"
            )
    if times[0] < 0:
        raise InputError(f"first point at {times[0] * 1e-9:g} s, before the start")
    start = stamp_ns or now_ns
    if start + times[-1] < now_ns:
        ago = (now_ns - start - times[-1]) * 1e-9
        raise InputError(f"trajectory ended {ago:.3f} s ago; send it with a later stamp")
    _check_end(checked[-1], r, expected_names)
    for k, point in enumerate(checked):
        _check_limits(k, point, limits, r.joint_limit_margin, expected_names)
    for k, (a, b) in enumerate(zip(checked, checked[1:], strict=False)):
        _check_mean_speed(k, a, b, limits, expected_names)
    jump = np.abs(checked[0].position - present_position)
    if jump.max() > r.start_jump_rad:
        j = int(np.argmax(jump))
        raise LimitError(
            f"first point is {jump[j]:.3f} rad from where {expected_names[j]} is, "
            f"limit {r.start_jump_rad} rad; start the trajectory at the present position"
        )
    return checked


def _order(given: list[str], expected: tuple[str, ...]) -> list[int]:
    if not given:
        raise InputError(f"trajectory names no joints; name {', '.join(expected)}")
    doubled = sorted({n for n in given if given.count(n) > 1})
    unknown = sorted(set(given) - set(expected))
    missing = sorted(set(expected) - set(given))
    if doubled or unknown or missing:
        raise InputError(f"joint names do not fit: unknown {unknown}, missing {missing}, twice {doubled}")
    return [given.index(n) for n in expected]


def _reordered(k: int, point: TrajectoryPoint, order: list[int]) -> TrajectoryPoint:
    columns: list[np.ndarray] = []
    for name in ("position", "velocity", "acceleration"):
        values = np.asarray(getattr(point, name), dtype=np.float64)
        if values.size == 0 and name != "position":
            columns.append(values)
            continue
        if values.shape != (len(order),):
            raise InputError(f"point {k} has {values.size} values of {name} for {len(order)} joints")
        if not np.isfinite(values).all():
            raise InputError(f"point {k}: {name} is not finite: {values}")
        columns.append(values[order])
    position, velocity, acceleration = columns
    return TrajectoryPoint(position, velocity, acceleration, point.time_from_start_ns)


def _check_end(last: TrajectoryPoint, rules: TrajectoryRules, names: tuple[str, ...]) -> None:
    if rules.allow_nonzero_velocity_at_trajectory_end or last.velocity.size == 0:
        return
    j = int(np.argmax(np.abs(last.velocity)))
    if abs(last.velocity[j]) > rules.stopped_velocity_tolerance:
        raise InputError(
            f"{names[j]} ends at {last.velocity[j]:.4f} rad/s, must be 0; "
            "end at rest or set allow_nonzero_velocity_at_trajectory_end"
        )


def _check_limits(
    k: int, point: TrajectoryPoint, limits: JointLimits, margin: float, names: tuple[str, ...]
) -> None:
    low, high = limits.lower + margin, limits.upper - margin
    outside = np.maximum(low - point.position, point.position - high)
    if outside.max() > 0:
        j = int(np.argmax(outside))
        raise LimitError(
            f"point {k}: {names[j]} at {point.position[j]:.4f} rad, allowed {low[j]:.4f} to {high[j]:.4f} rad"
            "; move the point inside"
        )
    for what, values, bound, unit in (
        ("velocity", point.velocity, limits.velocity, "rad/s"),
        ("acceleration", point.acceleration, limits.acceleration, "rad/s2"),
    ):
        if values.size and (np.abs(values) > bound).any():
            j = int(np.argmax(np.abs(values) / bound))
            raise LimitError(
                f"point {k}: {names[j]} {what} {values[j]:.3f} {unit}, limit {bound[j]:.3f} {unit}; "
                "give it more time"
            )


def _check_mean_speed(
    k: int, a: TrajectoryPoint, b: TrajectoryPoint, limits: JointLimits, names: tuple[str, ...]
) -> None:
    seconds = (b.time_from_start_ns - a.time_from_start_ns) * 1e-9
    speed = np.abs(b.position - a.position) / seconds
    over = speed / limits.velocity
    if over.max() > 1.0 + 1e-6:  # rounding of times to nanoseconds
        j = int(np.argmax(over))
        raise LimitError(
            f"points {k} and {k + 1}: {names[j]} moves {speed[j]:.3f} rad/s between them, limit "
            f"{limits.velocity[j]:.3f} rad/s; give it more time"
        )
