"""Set A: slow strokes to and fro at several speeds, with rests in between at varied gravity loads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.excitation.signal import from_velocity, rounded, sample_times
from samrl_core.cell.excitation.workspace import WorkBox
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.common.errors import InputError

SPEEDS = (0.03, 0.1, 0.3)  # crawl (stiction, Stribeck), slow, moderate [rad/s]
LEAST_HOLDS = 5  # from 8 s on
_MOST_HOLDS = 12
_DRAWS = 60


def varied_loads(box: WorkBox, model: ArmModel, rng: np.random.Generator, count: int) -> np.ndarray:
    """Positions (count, J) [rad] in the box whose gravity torques lie far apart, each next the farthest."""
    candidates = box.sample(rng, 150, share=0.85)
    load = np.array([model.gravity(q) for q in candidates]) / model.spec.limits.effort
    load /= load.std(axis=0) + 1e-3  # every joint counts, also those that gravity hardly loads
    chosen = [0]
    for _ in range(count - 1):
        apart = np.linalg.norm(load[:, None] - load[chosen][None], axis=2).min(axis=1)
        chosen.append(int(np.argmax(apart)))
    return candidates[chosen]


def rounding(duration_s: float) -> float:
    """Over which corners of the velocity are rounded [s]."""
    return float(np.clip(duration_s / 50.0, 0.05, 0.3))


def fastest_reversal(spec: RobotSpec, duration_s: float) -> np.ndarray:
    """Speeds (J,) [rad/s] of a reversal, a corner of twice the speed, at 0.6 of the acceleration limit."""
    return 0.15 * spec.limits.acceleration * rounding(duration_s)


def slow(
    spec: RobotSpec,
    model: ArmModel,
    box: WorkBox,
    rng: np.random.Generator,
    duration_s: float,
    period_s: float,
    speeds: Sequence[float] = SPEEDS,
    joints: np.ndarray | None = None,
    holds: int | None = None,
) -> JointSignal:
    """Between rests every joint makes two or more strokes, at speeds that go round among the joints.

    Reversals of different joints fall at different times, so that what happens at one is not mixed up
    with another's. `joints` (J,) bool moves only those. Speeds above `fastest_reversal` are reduced to it.

    Raises:
        InputError: too many holds for the time.
    """
    time = sample_times(duration_s, period_s)
    move = np.ones(len(spec.joint_names), bool) if joints is None else joints
    least = LEAST_HOLDS if duration_s >= 8.0 else 3
    count = int(np.clip(round(duration_s / 3.0), least, _MOST_HOLDS)) if holds is None else holds
    window = rounding(duration_s)
    # Rounding takes half a window at either side of a rest.
    rest = float(np.clip(0.03 * duration_s, 0.1, 0.6)) + window
    length = (duration_s - count * rest) / (count - 1)
    if length < 4.0 * window:
        raise InputError(
            f"{count} holds of {rest:.2f} s in {duration_s} s leave {length:.2f} s for the strokes between, "
            f"need {4.0 * window:.2f} s; lengthen the trajectory or name fewer poses"
        )
    targets = varied_loads(box, model, rng, count)
    top = fastest_reversal(spec, duration_s)
    position = targets[0].copy()
    velocity = np.zeros((len(time), len(position)))
    for k in range(count - 1):
        begin = rest + k * (length + rest)
        if k % len(speeds) == 0:
            turn = rng.permutation(len(position))
        for j in np.flatnonzero(move):
            speed = min(float(speeds[(turn[j] + k) % len(speeds)]), float(top[j]))
            low, high = box.center[j] - box.half_width, box.center[j] + box.half_width
            times, signs, end = _strokes(rng, length, speed, position[j], targets[k + 1, j], low, high)
            for a, b, sign in zip(times, times[1:], signs, strict=False):
                velocity[(time >= begin + a) & (time < begin + b), j] = sign * speed
            position[j] = end
    return from_velocity(time, rounded(velocity, period_s, window), targets[0])


def _strokes(
    rng: np.random.Generator, length: float, speed: float, start: float, goal: float, low: float, high: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Times of turning (n + 1,) [s], signs (n,), and where the joint ends: near the goal, inside the box."""
    least = int(np.ceil(speed * length / (0.8 * (high - low))))
    best, best_cost = None, np.inf
    for _ in range(_DRAWS):
        count = int(rng.integers(2, 4)) + max(0, least - 1)
        shares = 0.15 / count * 2 + rng.dirichlet(np.ones(count))
        times = np.concatenate([[0.0], np.cumsum(shares / shares.sum())]) * length
        signs = rng.choice([-1.0, 1.0]) * (-1.0) ** np.arange(count)
        corners = start + np.concatenate([[0.0], np.cumsum(signs * speed * np.diff(times))])
        outside = max(0.0, low - corners.min(), corners.max() - high)
        cost = 100.0 * outside + abs(corners[-1] - goal)
        if cost < best_cost:
            best, best_cost = (times, signs, float(corners[-1])), cost
    assert best is not None
    return best
