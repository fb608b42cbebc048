"""When a quantity that was measured again and again took another value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

CHANCE = 0.01  # that a series without any change is said to have one
LEAST = 4  # values; with fewer, the scatter from day to day is not known
MAD_TO_STD = 1.4826  # of a Gaussian
MAD_EFFICIENCY = 0.37  # of a median absolute deviation against a standard deviation, for a Gaussian
RESOLUTION = 1e-9  # of the largest value: nothing is known better


@dataclass(frozen=True)
class ChangePoint:
    """A step between two neighbouring values."""

    index: int  # of the first value after it
    before: float  # weighted mean of the values since the change before
    after: float  # until the next one
    std: float  # of `after - before`
    p_value: float  # of such a step by chance, anywhere in its part of the series


def change_points(
    values: np.ndarray, std: np.ndarray, chance: float = CHANCE
) -> tuple[tuple[ChangePoint, ...], float]:
    """Steps of a series of values with their own uncertainty, in order, and the scatter beside it.

    Binary segmentation (A. Scott and M. Knott, Biometrics 30, 1974) with the likelihood ratio of two weighted
    means, corrected for the number of places tried (Bonferroni). What neighbours differ by beyond their
    uncertainty counts as scatter from day to day; it is taken from the median, which few steps do not move.

    Args:
        values: (N,) in order of time.
        std: (N,) standard deviation of each value.
        chance: of a false step in a series.

    Returns:
        The steps, none with fewer than `LEAST` values, and the scatter [unit of the values].
    """
    values, std = np.asarray(values, dtype=float), np.asarray(std, dtype=float)
    if len(values) < LEAST:
        return (), 0.0
    between = MAD_TO_STD * float(np.median(np.abs(np.diff(values)))) / np.sqrt(2.0)
    own = float(np.median(std))
    scatter = float(np.sqrt(max(between**2 - own**2, 0.0)))
    least = RESOLUTION * max(float(np.max(np.abs(values))), np.finfo(float).tiny)
    weight = 1.0 / np.maximum(std**2 + scatter**2, least**2)
    # Student's in place of Gauss's distribution, as far as the scatter is only estimated (Satterthwaite).
    known = (own / scatter) ** 2 + 1.0 if scatter > 0.0 else np.inf
    freedom = MAD_EFFICIENCY * (len(values) - 1) * known**2
    cuts: dict[int, float] = {}

    def split(first: int, last: int) -> None:
        if last - first < 2:
            return
        w, y = weight[first:last], values[first:last]
        left = np.cumsum(w)[:-1]
        right = w.sum() - left
        moment = np.cumsum(w * y)[:-1]
        step = (np.sum(w * y) - moment) / right - moment / left
        drop = step**2 / (1.0 / left + 1.0 / right)
        k = int(np.argmax(drop))
        p = min(1.0, len(drop) * float(2.0 * stats.t.sf(np.sqrt(drop[k]), freedom)))
        if p < chance:
            cuts[first + k + 1] = p
            split(first, first + k + 1)
            split(first + k + 1, last)

    split(0, len(values))
    edges = [0, *sorted(cuts), len(values)]
    means = [np.average(values[a:b], weights=weight[a:b]) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    variances = [1.0 / weight[a:b].sum() for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return tuple(
        ChangePoint(
            at,
            float(means[i]),
            float(means[i + 1]),
            float(np.sqrt(variances[i] + variances[i + 1])),
            cuts[at],
        )
        for i, at in enumerate(sorted(cuts))
    ), scatter
