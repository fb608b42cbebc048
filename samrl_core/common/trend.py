"""Slopes of what is measured over and over: neighbours in time are alike, and so count for less."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy


@dataclass(frozen=True)
class Trend:
    """A slope common to several series."""

    slope: float  # unit of the values per unit of time
    ci95: tuple[float, float]  # infinite with too few values
    values: int
    effective: float  # independent values that they are worth

    @property
    def includes_zero(self) -> bool:
        """Whether the values may as well be level."""
        return self.ci95[0] <= 0.0 <= self.ci95[1]


def common_trend(series: Sequence[tuple[np.ndarray, np.ndarray]]) -> Trend | None:
    """Least-squares slope of series with a level of their own each; None without a slope.

    N values whose residuals correlate by r from one to the next count for N (1 - r) / (1 + r): B. D. Santer
    et al., J. Geophys. Res. 105, 2000, eq. 6.

    Args:
        series: times and values (N,) each, evenly spaced.
    """
    some = [(t - t.mean(), y - y.mean()) for t, y in series if len(t) >= 2]
    if not some:
        return None
    times, values = (np.concatenate(parts) for parts in zip(*some, strict=True))
    spread = float(times @ times)
    if spread == 0.0:
        return None
    slope = float(times @ values / spread)
    left = [y - slope * t for t, y in some]
    power = sum(float(r @ r) for r in left)
    alike = sum(float(r[1:] @ r[:-1]) for r in left) / power if power > 0.0 else 0.0
    alike = min(max(alike, 0.0), 0.999)
    effective = len(values) * (1.0 - alike) / (1.0 + alike)
    degrees = effective - len(some) - 1
    if degrees <= 0.0:
        return Trend(slope, (-np.inf, np.inf), len(values), effective)
    error = np.sqrt(power / degrees / spread)
    half = float(scipy.stats.t.ppf(0.975, degrees) * error)
    return Trend(slope, (slope - half, slope + half), len(values), effective)
