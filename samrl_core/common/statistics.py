"""Intervals, tests and scores of what studies count and measure, over `scipy.stats` where it has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import scipy  # its `stats` is loaded at the first call: it takes a second, and most commands need none

NORMAL_95 = 1.959963984540054  # two-sided 95 % quantile of the normal distribution
RESAMPLES = 2000


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """95 % score interval of a share (E. B. Wilson, JASA 22, 1927); (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    found = scipy.stats.binomtest(int(successes), int(trials)).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


@dataclass(frozen=True)
class Share:
    """A share of cases with its Wilson interval; `value` is None without cases."""

    value: float | None
    ci95: tuple[float, float]
    successes: int
    trials: int

    @classmethod
    def of(cls, outcomes: Sequence[bool]) -> Share:
        """Count the true ones."""
        hits, trials = sum(bool(x) for x in outcomes), len(outcomes)
        return cls(hits / trials if trials else None, wilson_interval(hits, trials), hits, trials)

    def as_dict(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)


def fisher_p(successes: int, trials: int, other_successes: int, other_trials: int) -> float:
    """One-sided p that two independent shares are equal, against the first one being larger (Fisher)."""
    table = [[successes, trials - successes], [other_successes, other_trials - other_successes]]
    return float(scipy.stats.fisher_exact(table, alternative="greater").pvalue)


def mcnemar_p(first: Sequence[bool], second: Sequence[bool]) -> float:
    """The same of pairs, e.g. episodes of equal seeds: the exact test of McNemar (1947)."""
    pairs = list(zip(first, second, strict=True))
    wins, losses = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    if not wins + losses:
        return 1.0
    return float(scipy.stats.binomtest(wins, wins + losses, alternative="greater").pvalue)


def bootstrap_interval(
    samples: Sequence[Any],
    statistic: Callable[[Sequence[Any]], float],
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
) -> tuple[float, float]:
    """95 % percentile interval of a statistic of independent samples (Efron 1979).

    `scipy.stats.bootstrap` takes arrays of numbers, at least two of them, and is NaN as soon as one resample
    is. A sample here may be a whole episode, a resample of empty episodes has no statistic, and one sample
    has an interval of width zero.

    Args:
        samples: at least one, e.g. one per episode or per training seed.
        statistic: of a list of samples.
        rng: source of the resampling.
        resamples: how many.
    """
    picks = rng.integers(0, len(samples), (resamples, len(samples)))
    return _central_95([statistic([samples[i] for i in pick]) for pick in picks])


def pooled_median(
    by_episode: Mapping[int, Sequence[float]], rng: np.random.Generator
) -> tuple[float, tuple[float, float]]:
    """Median of all episodes' values, NaN of none, with its interval: an episode is resampled as a whole."""

    def median(some: Sequence[int]) -> float:
        every = [value for episode in some for value in by_episode[episode]]
        return float(np.median(every)) if every else float("nan")

    episodes = sorted(by_episode)
    return median(episodes), bootstrap_interval(episodes, median, rng)


def summarise_values(
    values: Sequence[float], rng: np.random.Generator, resamples: int = 1000
) -> dict[str, object]:
    """Mean, median and quartiles with bootstrap 95 % intervals of mean and median; None without values."""
    data = np.asarray([v for v in values if np.isfinite(v)], float)
    if not len(data):
        names = ("mean", "mean_ci95", "median", "median_ci95", "quartiles")
        return {"n": 0, **dict.fromkeys(names)}
    resampled = data[rng.integers(0, len(data), (resamples, len(data)))]
    return {
        "n": len(data),
        "mean": float(data.mean()),
        "mean_ci95": list(_central_95(resampled.mean(axis=1))),
        "median": float(np.median(data)),
        "median_ci95": list(_central_95(np.median(resampled, axis=1))),
        "quartiles": [float(v) for v in np.quantile(data, (0.25, 0.75))],
    }


def _central_95(values: Sequence[float] | np.ndarray) -> tuple[float, float]:
    low, high = np.nanquantile(values, [0.025, 0.975])
    return float(low), float(high)


def auroc(positive: Sequence[float], negative: Sequence[float]) -> float | None:
    """Probability that a positive's score exceeds a negative's, ties counting half; None without either."""
    if not len(positive) or not len(negative):
        return None
    # The p value is not used; "asymptotic" is the method that computes none exactly.
    u = scipy.stats.mannwhitneyu(positive, negative, method="asymptotic").statistic
    return float(u) / (len(positive) * len(negative))


def rejected_share(positive: Sequence[float], negative: Sequence[float], allowed: float = 0.05) -> Share:
    """Share of positives above the lowest threshold that at most `allowed` of the negatives exceed."""
    if not len(negative):
        return Share.of([])
    ordered = np.sort(np.asarray(negative, float))[::-1]
    threshold = ordered[min(int(np.floor(allowed * len(ordered))), len(ordered) - 1)]
    return Share.of([score > threshold for score in positive])


def expected_calibration_error(
    probabilities: Sequence[float], correct: Sequence[bool], bins: int = 10
) -> float | None:
    """Mean distance of stated probability and frequency over equal bins (Naeini et al., AAAI 2015)."""
    if not len(probabilities):
        return None
    p, y = np.asarray(probabilities, float), np.asarray(correct, float)
    index = np.minimum((p * bins).astype(int), bins - 1)
    parts = [(index == k) for k in range(bins) if (index == k).any()]
    return float(sum(m.mean() * abs(p[m].mean() - y[m].mean()) for m in parts))


def brier_score(probabilities: Sequence[float], correct: Sequence[bool]) -> float | None:
    """Mean squared difference of stated probability and outcome; None without cases."""
    if not len(probabilities):
        return None
    return float(np.mean((np.asarray(probabilities, float) - np.asarray(correct, float)) ** 2))


def risk_coverage(
    confidence: Sequence[float], correct: Sequence[bool], cases: int
) -> list[tuple[float, float]]:
    """(coverage, risk) when only the most confident are answered; `cases` counts those unanswered as well."""
    order = np.argsort(-np.asarray(confidence, float), kind="stable")
    wrong = np.cumsum(~np.asarray(correct, bool)[order]) if len(order) else np.zeros(0)
    return [((k + 1) / cases, float(w) / (k + 1)) for k, w in enumerate(wrong)]
