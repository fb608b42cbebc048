"""The slope of a signal without noise of its own that was rounded, or logged finely, at whatever times."""

from __future__ import annotations

import numpy as np

REACH_S = 0.005  # to either side: a cubic through so much is within 1 % of the slope up to the band of 25 Hz
DEGREE = 3


def find_slopes(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Time derivative (N, J) of samples (N, J) at increasing times (N,) [s]: of a cubic through neighbours.

    A goal that is rounded to 0.1 mrad every millisecond has differences with 20 mrad/s of noise, which a law
    that damps against their speed never had. Of sparse samples these are the central differences.
    """
    reach = int(REACH_S / float(np.median(np.diff(time))) + 1e-6)
    count = 2 * reach + 1
    if count <= DEGREE + 1 or len(time) < count:
        return np.asarray(np.gradient(values, time, axis=0))
    first = np.clip(np.arange(len(time)) - reach, 0, len(time) - count)
    around = first[:, None] + np.arange(count)
    away = (time[around] - time[:, None]) / REACH_S
    powers = away[:, :, None] ** np.arange(DEGREE + 1)
    gram = np.einsum("nkp,nkq->npq", powers, powers)
    moments = np.einsum("nkp,nkj->npj", powers, values[around])
    return np.asarray(np.linalg.solve(gram, moments)[:, 1]) / REACH_S
