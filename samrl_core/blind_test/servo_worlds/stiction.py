"""Servo machines whose description states friction, and that really stick: friction, encoders, loggers.

Dry friction holds an axis with whatever torque it takes, up to its level, and opposes it with that level once
it moves. That is a complementarity between the velocity at a step's end and the torque, solved axis by axis
in turn until all agree (projected Gauss-Seidel; Moreau 1988).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.blind_test.servo_worlds.links import Link

_SWEEPS, _SETTLED = 60, 1e-12
_MISSING = (0.0, 0.005)  # share of a log's rows
_LATE = (0.002, 0.03)  # standard deviation of stamps, of the time between two rows
_CUTOFF_HZ = (60.0, 200.0)  # of a drive's filter of its differenced encoder

Reader = Callable[[float, list[float], list[float]], tuple[list[float], list[float]]]


def hold_or_slip(
    free: np.ndarray, yielding: np.ndarray, most: Sequence[float], held: Sequence[float]
) -> list[float]:
    """Torques (n,) of dry friction in a step.

    Args:
        free: velocities (n,) at the step's end without it.
        yielding: velocity (n, n) that a torque takes off in the step, positive definite.
        most: levels (n,).
        held: torques (n,) of the step before, from which the search starts.
    """
    torque = np.clip(np.asarray(held, dtype=float), -np.asarray(most), np.asarray(most))
    velocity = free - yielding @ torque
    for _ in range(_SWEEPS):
        moved = 0.0
        for i, level in enumerate(most):
            wanted = min(max(torque[i] + velocity[i] / yielding[i, i], -level), level)
            change = wanted - torque[i]
            if change:
                velocity = velocity - yielding[:, i] * change
                torque[i] = wanted
                moved = max(moved, abs(change) * float(yielding[i, i]))
        if moved < _SETTLED:
            break
    return torque.tolist()


def with_friction(
    links: tuple[Link, ...], rub: Sequence[float], speed: Sequence[float], rng: np.random.Generator
) -> tuple[Link, ...]:
    """Links whose joints' friction is stated, to three digits, as a share of what motions ask.

    Args:
        links: without.
        rub: torque (n,) that friction is sized by [N m or N].
        speed: of the motions (n,) [rad/s or m/s].
        rng: of the world.
    """
    dry, wet = rng.uniform(0.03, 0.15, size=len(links)), rng.uniform(0.02, 0.15, size=len(links))
    return tuple(
        replace(link, friction=float(f"{r * a:.3g}"), damping=float(f"{r * b / v:.3g}"))
        for link, r, v, a, b in zip(links, rub, speed, dry, wet, strict=True)
    )


def near_stated(stated: float, width: float, share: float) -> float:
    """Friction of a machine: off what is stated by a share, -1..1, of a half width; never without any."""
    return max(0.2 * stated, stated + width * float(share))


def rounding_encoder(counts: Sequence[float], period: float, rng: np.random.Generator) -> Reader:
    """A drive's reading: positions in whole counts (n,) per rad or m, and their differences, filtered.

    Args:
        counts: of each encoder.
        period: of the drive [s].
        rng: of the world, for the filter's cutoff.
    """
    keep = math.exp(-2.0 * math.pi * float(rng.uniform(*_CUTOFF_HZ)) * period)
    last: list[list[float]] = []
    speed = [0.0] * len(counts)

    def read(t: float, q: list[float], v: list[float]) -> tuple[list[float], list[float]]:
        seen = [round(x * c) / c for x, c in zip(q, counts, strict=True)]
        before = last.pop() if last else seen
        last.append(seen)
        for i, (now, then) in enumerate(zip(seen, before, strict=True)):
            speed[i] = keep * speed[i] + (1.0 - keep) * (now - then) / period
        return seen, speed.copy()

    return read


def ragged(table: dict[str, np.ndarray], rng: np.random.Generator, digits: int = 6) -> dict[str, np.ndarray]:
    """A log (N,) by column as busy computers write it: some rows are missing, stamps come late."""
    share, late = float(rng.uniform(*_MISSING)), float(rng.uniform(*_LATE))
    time = table["time"]
    there = rng.random(len(time)) >= share
    there[[0, -1]] = True
    step = float(np.median(np.diff(time)))
    jitter = np.clip(rng.normal(size=len(time)) * late, -0.1, 0.1) * step
    return {**{k: v[there] for k, v in table.items()}, "time": np.round((time + jitter)[there], digits)}
