"""Intervals and tests of what experiments count and measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest, fisher_exact

RESAMPLES = 2000


def bootstrap_ci(
    samples: Sequence[Any],
    statistic: Callable[[Sequence[Any]], float],
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
) -> tuple[float, float]:
    """95 % percentile interval of a statistic of independent samples (Efron 1979).

    Args:
        samples: at least one, e.g. one per episode or per training seed.
        statistic: of a list of samples.
        rng: source of the resampling.
        resamples: how many.
    """
    count = len(samples)
    found = [statistic([samples[i] for i in rng.integers(0, count, count)]) for _ in range(resamples)]
    low, high = np.nanquantile(found, [0.025, 0.975])
    return float(low), float(high)


def pooled_median(
    by_episode: Mapping[int, Sequence[float]], rng: np.random.Generator
) -> tuple[float, tuple[float, float]]:
    """Median of all episodes' values, NaN of none, with its interval: an episode is drawn as a whole."""

    def median(some: Sequence[int]) -> float:
        every = [value for episode in some for value in by_episode[episode]]
        return float(np.median(every)) if every else float("nan")

    episodes = sorted(by_episode)
    return median(episodes), bootstrap_ci(episodes, median, rng)


def more_often(successes: int, trials: int, other_successes: int, other_trials: int) -> float:
    """One-sided p that two independent shares are equal, against the first one being larger (Fisher)."""
    table = [
        [successes, trials - successes],
        [other_successes, other_trials - other_successes],
    ]
    result: Any = fisher_exact(table, alternative="greater")
    return float(result.pvalue)


def more_often_paired(first: Sequence[bool], second: Sequence[bool]) -> float:
    """The same of pairs, e.g. episodes of equal seeds: the exact test of McNemar (1947)."""
    pairs = list(zip(first, second, strict=True))
    wins, losses = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    return float(binomtest(wins, wins + losses, alternative="greater").pvalue) if wins + losses else 1.0
