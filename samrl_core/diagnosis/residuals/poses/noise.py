"""Noise of detected poses, from what the recording itself leaves when everything in the chain may be off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError

POWERS = (0, 1, 2)  # of the distance with which noise of a detected pose may grow
ALIKE = ((0, 1), (2,), (3, 4, 5))  # channels that grow alike: across the view, along it, turns
CLEARLY = 5.0  # [nat] by which growing noise must be likelier than even noise
FREEDOM = 4.0  # of the Student distribution that tells it
LEAST_SPREAD = 0.3  # of the distance's logarithm, below which growth does not show
ROBUST = 1.4826  # of a median absolute deviation, for a Gaussian
OUTLIER = 6.0  # standard deviations beyond which a detection is not one of the target
ROUNDS = 6
LEAST = np.array([1e-6] * 3 + [1e-6] * 3)  # [m], [rad]: rounding of a log


@dataclass(frozen=True, eq=False)
class DetectorNoise:
    """Noise of detected poses, by the target's distance."""

    level: np.ndarray  # (6,) standard deviations at 1 m [m], [rad]
    power: np.ndarray  # (6,) of the distance

    def at(self, distance: np.ndarray) -> np.ndarray:
        """Standard deviations (N, 6) at distances (N,) [m]."""
        return self.level * distance[:, None] ** self.power


def growth_power(left: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Powers (6,) of the distance (N,) with which what is left (N, 6) grows; 0 where it does not clearly.

    A corner's noise in pixels moves a pose across the view with the distance, and along it and in its turns
    up to its square. By the likelihood of a Student distribution, which wrong detections hardly move.
    """
    out, x = np.zeros(left.shape[1]), np.log(distance)
    if float(np.ptp(x)) < LEAST_SPREAD:
        return out
    x = x - x.mean()
    for channels in ALIKE:
        y = left[:, list(channels)]
        likely = np.array([_log_student(y * np.exp(-p * x)[:, None]) for p in POWERS])
        best = int(np.argmax(likely))
        out[list(channels)] = POWERS[best] if likely[best] > likely[0] + CLEARLY else 0
    return out


def _log_student(values: np.ndarray) -> float:
    """Log likelihood of columns (N, K) at the likeliest scale of each, up to a constant."""
    level = np.maximum(ROBUST * np.median(np.abs(values), axis=0), 1e-12)
    for _ in range(2 * ROUNDS):  # expectation and maximisation
        weight = (FREEDOM + 1.0) / (FREEDOM + (values / level) ** 2)
        level = np.maximum(np.sqrt(np.mean(weight * values**2, axis=0)), 1e-12)
    fallen = 0.5 * (FREEDOM + 1.0) * np.log1p((values / level) ** 2 / FREEDOM)
    return -float(np.sum(fallen + np.log(level)))


def leftover(residual: np.ndarray, columns: Sequence[np.ndarray], spread: Sequence[float]) -> np.ndarray:
    """Residuals (N, 6) after a robust fit of columns (N, 6) with Gaussian priors, scaled to their freedom.

    Cauchy weights keep wrong detections from pulling the fit (Huber 1981, Robust Statistics).
    """
    design = np.stack([c.reshape(-1) * s for c, s in zip(columns, spread, strict=True)], axis=1)
    y = residual.reshape(-1)
    left, used = residual, 0.0
    for _ in range(ROUNDS):
        level = scale(left)
        weight = 1.0 / (1.0 + (left / (2.5 * level)) ** 2)
        root = (np.sqrt(weight) / level).reshape(-1)
        a, b = design * root[:, None], y * root
        with np.errstate(over="ignore", invalid="ignore"):
            normal = a.T @ a
        if not np.isfinite(normal).all():
            raise InputError(
                f"poses change by up to {np.abs(design).max():.3g} m or rad; check the stamps and the unit"
            )
        # Where all that can be off moves the poses alike, rounding may hide the prior: no inverse is there.
        inverse = np.linalg.pinv(normal + np.eye(len(normal)), hermitian=True)
        left = (y - design @ (inverse @ (a.T @ b))).reshape(residual.shape)
        used = float(np.trace(inverse @ normal))
    return left * np.sqrt(y.size / max(y.size - used, 0.25 * y.size))


def scale(values: np.ndarray) -> np.ndarray:
    """Robust standard deviation (6,) of residuals (N, 6)."""
    return np.maximum(ROBUST * np.median(np.abs(values - np.median(values, axis=0)), axis=0), LEAST)


def noise_level(left: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """Standard deviation (6,) of what is left: its white part, and of what lasts no more than `floor` (6,).

    Differences of neighbours hold the white part alone. Errors of a detector last over neighbouring views;
    beyond what detectors are known for, what lasts is a gap.
    """
    white = np.maximum(scale(np.diff(left, axis=0)) / np.sqrt(2.0), LEAST) if len(left) > 4 else scale(left)
    lasting = np.sqrt(np.maximum(scale(left) ** 2 - white**2, 0.0))
    return np.hypot(white, np.minimum(lasting, floor))
