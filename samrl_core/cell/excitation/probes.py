"""Motions that answer one question: rests only, one chirp, tiny reversals, long strokes at constant speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.excitation.multisine import chirp_velocity
from samrl_core.cell.excitation.signal import (
    from_velocity,
    minimum_jerk_length,
    minimum_jerk_velocity,
    rounded,
    sample_times,
)
from samrl_core.cell.excitation.slow_sweep import varied_loads
from samrl_core.cell.excitation.workspace import WorkBox
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError

_SHARE = 0.3  # of velocity and acceleration limits, on the way between poses
_CHIRP_ACCELERATION = 0.45  # of the limit
_REST_S = 0.2


def _visits(
    spec: RobotSpec, model: ArmModel, box: WorkBox, rng: np.random.Generator, joints: np.ndarray, poses: int
) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """Poses (N, J) [rad] whose gravity loads lie far apart, ways (N - 1, J) between them, their times [s]."""
    goals = varied_loads(box, model, rng, poses)
    goals[:, ~joints] = box.center[~joints]
    ways = np.diff(goals, axis=0)
    limits = spec.limits
    moves = [
        max(0.3, minimum_jerk_length(w, _SHARE * limits.velocity, _SHARE * limits.acceleration)) for w in ways
    ]
    return goals, ways, moves


def static(
    spec: RobotSpec,
    model: ArmModel,
    box: WorkBox,
    rng: np.random.Generator,
    duration_s: float,
    period_s: float,
    joints: np.ndarray,
    poses: int,
) -> JointSignal:
    """Rests of equal length at poses whose gravity loads lie far apart; other joints stay.

    Raises:
        InputError: no time is left to rest.
    """
    time = sample_times(duration_s, period_s)
    goals, ways, moves = _visits(spec, model, box, rng, joints, poses)
    rest = (duration_s - sum(moves)) / poses
    if rest < 0.3:
        raise InputError(
            f"{poses} poses in {duration_s} s leave {rest:.2f} s of rest each, need 0.3 s; "
            f"set parameters.duration_s to at least {sum(moves) + 0.3 * poses:.1f} or name fewer poses"
        )
    velocity, now = np.zeros((len(time), len(joints))), rest
    for way, length in zip(ways, moves, strict=True):
        velocity += minimum_jerk_velocity(time, now, length, way)
        now += length + rest
    return from_velocity(time, velocity, goals[0])


def chirp(
    spec: RobotSpec,
    box: WorkBox,
    duration_s: float,
    period_s: float,
    joints: np.ndarray,
    band_hz: tuple[float, float],
    speed: float,
) -> JointSignal:
    """The named joints one after the other, each a sweep over the band, bounded in speed and acceleration."""
    time = sample_times(duration_s, period_s)
    moving = np.flatnonzero(joints)
    length = (duration_s - 2 * _REST_S) / len(moving)
    velocity = np.zeros((len(time), len(joints)))
    for turn, j in enumerate(moving):
        span = (_REST_S + turn * length, _REST_S + (turn + 1) * length)
        top = _CHIRP_ACCELERATION * spec.limits.acceleration[j]
        velocity[:, j] = chirp_velocity(time, span, band_hz, top, speed=speed)
    velocity[[0, -1]] = 0.0
    return from_velocity(time, velocity, box.center)


def micro_reversals(
    spec: RobotSpec,
    model: ArmModel,
    box: WorkBox,
    rng: np.random.Generator,
    duration_s: float,
    period_s: float,
    joints: np.ndarray,
    amplitude: float,
    speed: float,
    poses: int,
) -> JointSignal:
    """Triangles of a few milliradians about several poses, a joint's period unlike another's.

    Raises:
        InputError: not one whole triangle fits into a visit of a pose.
    """
    time = sample_times(duration_s, period_s)
    goals, ways, moves = _visits(spec, model, box, rng, joints, poses)
    stay = (duration_s - sum(moves) - 2 * _REST_S) / poses
    period = 4.0 * amplitude / speed
    if stay < 2.0 * period:
        raise InputError(
            f"{poses} poses in {duration_s} s leave {stay:.2f} s each, two triangles of {amplitude} rad at "
            f"{speed} rad/s take {2 * period:.2f} s; lengthen parameters.duration_s or name fewer poses"
        )
    velocity = np.zeros((len(time), len(joints)))
    now, smooth = _REST_S, min(0.25 * period, 0.05)
    small = np.zeros_like(velocity)
    for k in range(poses):
        for j in np.flatnonzero(joints):
            count = int(stay // (period * rng.uniform(1.0, 1.3)))  # whole triangles, so that the pose is kept
            own = (stay - smooth) / count
            s = ((time - now - 0.5 * smooth) / own) % 1.0
            inside = (time >= now + 0.5 * smooth) & (time < now + 0.5 * smooth + count * own)
            sign = rng.choice([-1.0, 1.0])
            small[inside, j] = (
                sign * np.where((s < 0.25) | (s >= 0.75), 1.0, -1.0)[inside] * 4 * amplitude / own
            )
        now += stay
        if k < len(ways):
            velocity += minimum_jerk_velocity(time, now, moves[k], ways[k])
            now += moves[k]
    return from_velocity(time, velocity + rounded(small, period_s, smooth), goals[0])


def sweep(
    spec: RobotSpec,
    box: WorkBox,
    rng: np.random.Generator,
    duration_s: float,
    period_s: float,
    joints: np.ndarray,
    speeds: Sequence[float],
    amplitude: float,
) -> JointSignal:
    """Long strokes of the named joints to and fro at constant speed, one speed after the other.

    Raises:
        InputError: a slow speed would need longer than the trajectory for one stroke to and fro.
    """
    time = sample_times(duration_s, period_s)
    moving = np.flatnonzero(joints)
    window = 0.4
    length = (duration_s - 2 * _REST_S) / len(moving)
    # Half a period at one speed: there and back over the stroke, from and to its middle.
    needed = sum(4.0 * amplitude / v for v in speeds) + window * len(speeds)
    if needed > length:
        raise InputError(
            f"strokes of +-{amplitude} rad at {list(speeds)} rad/s take {needed:.1f} s a joint, there are "
            f"{length:.1f} s; set parameters.duration_s to at least "
            f"{needed * len(moving) + 2 * _REST_S:.1f} or reduce amplitude or joints"
        )
    velocity = np.zeros((len(time), len(joints)))
    for turn, j in enumerate(moving):
        now, sign = _REST_S + turn * length, rng.choice([-1.0, 1.0])
        for v in speeds:
            quarter = amplitude / v
            for share, way in ((1, 1.0), (2, -1.0), (1, 1.0)):
                inside = (time >= now) & (time < now + share * quarter)
                velocity[inside, j] = sign * way * v
                now += share * quarter
            now += window
    velocity = rounded(velocity, period_s, window)
    velocity[[0, -1]] = 0.0  # the tail of the rounding, some 1e-7
    return from_velocity(time, velocity, box.center)
