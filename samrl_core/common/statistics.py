"""Small statistics of a score: ranking, calibration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.common.share import Share


def auroc(positive: Sequence[float], negative: Sequence[float]) -> float | None:
    """Probability that a positive's score exceeds a negative's, ties counting half; None without either."""
    if not len(positive) or not len(negative):
        return None
    a, b = np.asarray(positive, float)[:, None], np.asarray(negative, float)[None, :]
    return float(np.mean((a > b) + 0.5 * (a == b)))


def rejected_at(positive: Sequence[float], negative: Sequence[float], allowed: float = 0.05) -> Share:
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


def brier(probabilities: Sequence[float], correct: Sequence[bool]) -> float | None:
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


def summary(values: Sequence[float], rng: np.random.Generator, draws: int = 1000) -> dict[str, object]:
    """Mean, median and quartiles with bootstrap 95 % intervals of mean and median; None without values."""
    data = np.asarray([v for v in values if np.isfinite(v)], float)
    if not len(data):
        return {
            "n": 0,
            "mean": None,
            "mean_ci95": None,
            "median": None,
            "median_ci95": None,
            "quartiles": None,
        }
    resampled = data[rng.integers(0, len(data), (draws, len(data)))]

    def interval(x: np.ndarray) -> list[float]:
        return [float(v) for v in np.quantile(x, (0.025, 0.975))]

    return {
        "n": len(data),
        "mean": float(data.mean()),
        "mean_ci95": interval(resampled.mean(axis=1)),
        "median": float(np.median(data)),
        "median_ci95": interval(np.median(resampled, axis=1)),
        "quartiles": [float(v) for v in np.quantile(data, (0.25, 0.75))],
    }
