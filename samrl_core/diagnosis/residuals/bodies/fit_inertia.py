"""Moments of inertia that free rotations show: a large error is no multiple of a small one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.residuals.bodies.free_rotation import FreeRotation, free_rotation
from samrl_core.diagnosis.residuals.bodies.segment import Segment

ROUNDS = 5
SMALL = 0.03  # relative error up to which columns at the stated inertia serve
WITHIN = (-0.6, 1.5)  # relative errors that are tried
MOST = 12  # flights that are fitted


def inertia_errors(flights: Sequence[Segment], gyration: np.ndarray) -> np.ndarray:
    """Relative errors (2,) of the first two moments of inertia, the third held, by Gauss-Newton.

    Zeros where they are small, or no flight tells them.
    """
    longest = sorted(flights, key=len)[-MOST:]
    errors = np.zeros(2)
    for _ in range(ROUNDS if longest else 0):
        product, moment = np.zeros((2, 2)), np.zeros(2)
        for s in longest:
            columns, rest = _without_start(free_rotation(s.time, s.turned, _with(gyration, errors)))
            columns = columns / (1.0 + errors)
            far = 6.0 * float(np.median(np.abs(rest)))
            product += columns.T @ columns
            moment += columns.T @ np.clip(rest, -far, far)
        if float(np.linalg.eigvalsh(product)[0]) <= 1e-9 * float(np.trace(product)):
            return np.zeros(2)
        step = np.linalg.solve(product, moment)
        errors = np.clip(errors + step, *WITHIN)
        if float(np.max(np.abs(step))) < 1e-3:
            break
    return errors if float(np.max(np.abs(errors))) > SMALL else np.zeros(2)


def with_secant(
    nominal: FreeRotation, flight: Segment, gyration: np.ndarray, errors: np.ndarray
) -> FreeRotation:
    """The nominal rotation with columns of inertia that are exact at the given errors (2,).

    Derivatives at the errors, corrected by rank one so that the errors themselves give the whole difference
    (Broyden 1965).
    """
    size = float(errors @ errors)
    if size == 0.0:
        return nominal
    there = free_rotation(flight.time, flight.turned, _with(gyration, errors))
    derivative = there.inertia / (1.0 + errors)[:, None, None]
    missing = nominal.residual - there.residual - np.einsum("k,knj->nj", errors, derivative)
    return replace(nominal, inertia=derivative + errors[:, None, None] * missing / size)


def _with(gyration: np.ndarray, errors: np.ndarray) -> np.ndarray:
    return gyration * np.array([1.0 + errors[0], 1.0 + errors[1], 1.0])


def _without_start(rotation: FreeRotation) -> tuple[np.ndarray, np.ndarray]:
    """Columns (3n, 2) and residual (3n,) without what a start can do."""
    start = np.linalg.qr(rotation.start.reshape(6, -1).T)[0]
    columns, rest = rotation.inertia.reshape(2, -1).T, rotation.residual.reshape(-1)
    return columns - start @ (start.T @ columns), rest - start @ (start.T @ rest)
