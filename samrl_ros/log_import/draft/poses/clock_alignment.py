"""How far the clocks of a target's and a flange's poses are apart, by how fast both turn.

Target in camera and flange in base turn at the same speed, whatever the transforms between them are (Furrer
et al. 2017, Evaluation of combined time-offset estimation and hand-eye calibration on robotic datasets).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import correlate

STEP_S = 0.02  # of the grid that speeds are compared on
OVER_S = 0.1  # over which a speed is told, so that noise of single poses does not count
GAP_S = 0.5  # without poses, over which nothing is said
SHARED = 0.5  # of the shorter log that must lie in the other, and no less than
LEAST_S = 8.0
LONGEST_S = 3600.0  # of a log that is compared
MEDIAN_OF = 5  # neighbouring speeds
AGREES, CLEARLY = 0.8, 0.3  # correlation at the offset, and by how much it is more than without one


@dataclass(frozen=True)
class Alignment:
    """What is to be added to the second log's time."""

    offset_s: float
    correlation: float  # of both speeds then
    without: float  # likewise as the stamps are; 0 where they share no time

    @property
    def is_clear(self) -> bool:
        """Whether both turn alike then, and do not as the stamps are."""
        return self.correlation > AGREES and self.correlation > self.without + CLEARLY


def align_clocks(
    time: np.ndarray, turns: np.ndarray, other_time: np.ndarray, other_turns: np.ndarray
) -> Alignment | None:
    """The offset at which two logs turn at the same speed; None where they are too short, or rest.

    Args:
        time: (N,) [s], increasing.
        turns: (N, 4) quaternions, in any order.
        other_time: (M,) [s], of the other log.
        other_turns: (M, 4).
    """
    first, second = _speeds(time, turns), _speeds(other_time, other_turns)
    if first is None or second is None:
        return None
    (a, seen_a), (b, seen_b) = first, second

    def slide(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return correlate(x, y, mode="full", method="fft")

    count = np.maximum(slide(seen_a, seen_b), 1.0)
    sum_a, sum_b = slide(a, seen_b), slide(seen_a, b)
    power = (slide(a**2, seen_b) - sum_a**2 / count) * (slide(seen_a, b**2) - sum_b**2 / count)
    least = max(LEAST_S / STEP_S, SHARED * min(seen_a.sum(), seen_b.sum()))
    fits = (count >= least) & (power > 1e-12 * power.max())
    if not fits.any():
        return None
    alike = np.where(fits, (slide(a, b) - sum_a * sum_b / count) / np.sqrt(np.where(fits, power, 1.0)), -1.0)
    best = int(np.argmax(alike))
    lag = float(best)
    if 0 < best < len(alike) - 1 and (bend := alike[best - 1] + alike[best + 1] - 2 * alike[best]) < 0:
        lag += 0.5 * float(alike[best - 1] - alike[best + 1]) / float(bend)
    # Full correlation: a lag of len(b) - 1 lays both grids' beginnings on each other.
    offset = float(time[0] - other_time[0]) + STEP_S * (lag - (len(b) - 1))
    still = round((other_time[0] - time[0]) / STEP_S) + len(b) - 1
    without = float(alike[still]) if 0 <= still < len(alike) and fits[still] else 0.0
    return Alignment(offset, float(alike[best]), without)


def _speeds(time: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Speed of turning on a grid (G,) [rad/s], and where it is known (G,), 1 or 0."""
    inside = time - time[0] < LONGEST_S
    time, turns = time[inside], turns[inside]
    if len(time) < 3 or time[-1] - time[0] < LEAST_S:
        return None
    far = max(1, round(OVER_S / float(np.median(np.diff(time)))))
    if len(time) <= far + 2:
        return None
    span = time[far:] - time[:-far]
    dots = np.abs((turns[far:] * turns[:-far]).sum(axis=1))
    speed = 2.0 * np.arccos(np.clip(dots, 0.0, 1.0)) / span
    whole = span < 2.0 * max(OVER_S, float(np.median(span)))  # over no gap
    if whole.sum() <= MEDIAN_OF:
        return None
    # A mistaken pose makes two speeds wrong that stand apart.
    speed = median_filter(speed[whole], MEDIAN_OF)
    middle = 0.5 * (time[far:] + time[:-far])[whole]
    grid = np.arange(time[0], time[-1], STEP_S)
    after = np.clip(np.searchsorted(middle, grid), 1, len(middle) - 1)
    known = (middle[after] - middle[after - 1] < GAP_S) & (grid >= middle[0]) & (grid <= middle[-1])
    speeds = np.interp(grid, middle, speed)
    if not known.any() or np.ptp(speeds[known]) == 0.0:
        return None
    return np.where(known, speeds - speeds[known].mean(), 0.0), known.astype(float)
