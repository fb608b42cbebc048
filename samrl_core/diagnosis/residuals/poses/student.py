"""The likelihood of a Student distribution, which wrong detections hardly move."""

from __future__ import annotations

import numpy as np

FREEDOM = 4.0
ROBUST = 1.4826  # of a median absolute deviation, for a Gaussian
_ROUNDS = 12  # of expectation and maximisation


def log_student(values: np.ndarray) -> float:
    """Log likelihood of columns (N, K) at the likeliest scale of each, up to a constant."""
    level = np.maximum(ROBUST * np.median(np.abs(values), axis=0), 1e-12)
    for _ in range(_ROUNDS):
        weight = (FREEDOM + 1.0) / (FREEDOM + (values / level) ** 2)
        level = np.maximum(np.sqrt(np.mean(weight * values**2, axis=0)), 1e-12)
    fallen = 0.5 * (FREEDOM + 1.0) * np.log1p((values / level) ** 2 / FREEDOM)
    return -float(np.sum(fallen + np.log(level)))
