"""One uninterrupted motion of a body: what it would do by the nominal model, and what noise leaves of it.

Forces are integrated twice along the measured motion, so residuals are positions, whose noise is the
tracker's own, and every force that depends on the measured motion is linear in its size (integral form of
equation errors; Schaeffer and McCalla 2017). Nobody knows where a motion began and how fast: what a start can
do is taken out of residuals and columns alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.spatial.transform import Rotation

PATTERNS = (2, 3, 4)  # Legendre orders of the errors of a tracker that last over a motion


@dataclass(frozen=True, eq=False)
class Segment:
    """A flight or a slide.

    Attributes:
        kind: flight or slide.
        recording: index among those of its trial.
        time: (n,) [s] of its recording.
        position: (n, 3) [m] of the stated centre of mass.
        velocity: (n, 3) [m/s], smoothed.
        turned: (n, 3, 3) of the tracked frame; identities where turns were not measured.
        normal: (3,) of the support; zeros in flight.
        gravity: (3,) [m/s^2].
        direction: (n, 3) unit vectors of sliding; zeros in flight.
        share: of the forces that move it forward: less than 1 where it rolls.
    """

    kind: str
    recording: int
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    turned: np.ndarray
    normal: np.ndarray
    gravity: np.ndarray
    direction: np.ndarray
    share: float = 1.0

    def __len__(self) -> int:
        return len(self.time)

    @property
    def slides(self) -> bool:
        """Whether it is in contact with the support."""
        return self.kind == "slide"

    @property
    def load(self) -> float:
        """Normal force over mass [m/s^2]; 0 in flight."""
        return -float(self.normal @ self.gravity)

    def tangential(self, gravity: np.ndarray) -> np.ndarray:
        """What a field (3,) [m/s^2] does to the motion, friction aside."""
        if not self.slides:
            return gravity
        return self.share * (gravity - self.normal * float(self.normal @ gravity))

    def nominal(self, friction: float) -> np.ndarray:
        """Acceleration (n, 3) [m/s^2] at a coefficient of friction, along the measured motion."""
        braked = self.share * friction * self.load * self.direction
        return self.tangential(self.gravity) - braked

    def travelled(self, acceleration: np.ndarray) -> np.ndarray:
        """Displacement (..., n, 3) [m] by accelerations (..., n, 3) that are linear between samples."""
        steps = np.diff(self.time)[:, None]
        first, last = acceleration[..., :-1, :], acceleration[..., 1:, :]
        speed = np.zeros_like(acceleration)
        speed[..., 1:, :] = np.cumsum(steps * 0.5 * (first + last), axis=-2)
        out = np.zeros_like(acceleration)
        out[..., 1:, :] = np.cumsum(
            steps * speed[..., :-1, :] + steps**2 * (2.0 * first + last) / 6.0, axis=-2
        )
        return out


class Cleaner:
    """Takes out of rows what a start can do, and shrinks what a tracker's lasting errors can do."""

    def __init__(self, free: np.ndarray, patterns: np.ndarray, sigma: np.ndarray) -> None:
        """`free` (m, n): what may have any size; `patterns` (k, n): of standard deviation 1; sigma (n,)."""
        self._sigma = sigma
        self._start = np.linalg.qr((free / sigma).T)[0]
        rest = (patterns / sigma).T
        rest = rest - self._start @ (self._start.T @ rest)
        u, s, _ = np.linalg.svd(rest, full_matrices=False)
        kept = s > 1e-6
        self._lasting, self._lost = u[:, kept], 1.0 - 1.0 / np.sqrt(1.0 + s[kept] ** 2)

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        """Rows (..., n) cleaned."""
        y = rows / self._sigma
        y = y - (y @ self._start) @ self._start.T
        y = y - ((y @ self._lasting) * self._lost) @ self._lasting.T
        return y * self._sigma


def polynomials(time: np.ndarray, orders: Sequence[int]) -> np.ndarray:
    """Legendre polynomials (K, n) over the span of times (n,)."""
    span = max(float(time[-1] - time[0]), 1e-9)
    x = 2.0 * (time - time[0]) / span - 1.0
    return np.stack([legendre.legval(x, np.eye(k + 1)[k]) for k in orders])


def smoothness(time: np.ndarray) -> int:
    """Order of the polynomial that follows a motion over times (n,), and none of the noise."""
    span = float(time[-1] - time[0])
    return int(np.clip(3 + round(span / 0.25), 3, max(2, min(10, len(time) // 5))))


def smoothed(time: np.ndarray, values: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, k) and their rates by a robust fit of a polynomial (Cauchy's weights)."""
    span = max(float(time[-1] - time[0]), 1e-9)
    x = 2.0 * (time - time[0]) / span - 1.0
    basis = legendre.legvander(x, order)
    rates = np.stack(
        [legendre.legval(x, legendre.legder(np.eye(order + 1)[k])) for k in range(order + 1)], axis=1
    )
    fits, speeds = np.empty_like(values), np.empty_like(values)
    for k, column in enumerate(values.T):
        weight = np.ones(len(time))
        for _ in range(4):
            a = np.linalg.lstsq(basis * weight[:, None], column * weight, rcond=None)[0]
            left = column - basis @ a
            level = max(1.4826 * float(np.median(np.abs(left))), 1e-9)
            weight = np.sqrt(1.0 / (1.0 + (left / (3.0 * level)) ** 2))
        fits[:, k], speeds[:, k] = basis @ a, (rates @ a) * 2.0 / span
    return fits, speeds


def rotations(quat_xyzw: np.ndarray, count: int) -> np.ndarray:
    """Matrices (N, 3, 3) of quaternions (N, 4); identities where there are none."""
    if not len(quat_xyzw):
        return np.broadcast_to(np.eye(3), (count, 3, 3))
    return Rotation.from_quat(quat_xyzw).as_matrix()
