"""Poses that are none of the body: detections of something else, alone or few in a row.

A pose strays where a cubic through its neighbours misses it by far, and no cubic does once it is left out. At
an impact, too, no cubic fits, but leaving a pose out does not change that: impacts stay.
"""

from __future__ import annotations

import numpy as np

FAR = 7.0  # standard deviations
LEAST_M = 2e-3  # [m] by which a pose must be missed
LONGEST = 3  # poses in a row
CLEARLY = 2.0  # times far, from which on several in a row may stray: a weak impact lies within two poses
MOST = 0.2  # share of all poses


def stray_poses(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Mask (N,) of positions (N, K) that stray; none where more than `MOST` would."""
    count = len(time)
    stray = np.zeros(count, dtype=bool)
    if count < 12:
        return stray
    # Third differences hold noise as the cubics here do, and few of them hold a stray pose.
    third = np.diff(position, 3, axis=0)
    spread = 1.4826 * np.median(np.abs(third - np.median(third, axis=0)), axis=0)
    noise = spread / np.sqrt(20.0)
    stuck: set[int] = set()
    for _ in range(int(MOST * count)):
        kept = np.flatnonzero(~stray)
        score = _scores(time[kept], position[kept], noise)
        score[[k for k, row in enumerate(kept) if row in stuck]] = 0.0
        k = int(np.argmax(score))
        if score[k] < 1.0:
            return stray
        longest = LONGEST if score[k] > CLEARLY else 1
        run = _smallest_run(time, position, noise, kept, k, longest)
        if run is None:
            stuck.add(int(kept[k]))
        else:
            stray[kept[run]] = True
    return np.zeros(count, dtype=bool)


def _smallest_run(
    time: np.ndarray, position: np.ndarray, noise: np.ndarray, kept: np.ndarray, k: int, longest: int
) -> np.ndarray | None:
    """Indices into `kept` around k whose leaving out makes their neighbours fit; None where none does."""
    for length in range(1, longest + 1):
        for first in range(k - length, k + 2):  # the worst may be a neighbour of what strays
            run = np.arange(first, first + length)
            if run[0] < 0 or run[-1] >= len(kept):
                continue
            near = np.arange(max(0, first - 4), min(len(kept), first + length + 4))
            near = kept[near[~np.isin(near, run)]]
            if len(near) >= 6 and float(np.max(_scores(time[near], position[near], noise))) < 1.0:
                return run
    return None


def _scores(time: np.ndarray, position: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """By how much (N,) a cubic through two poses on either side misses each, over what is far."""
    out = np.zeros(len(time))
    if len(time) < 5:
        return out
    t = time[2:-2]
    around = np.stack([time[:-4], time[1:-3], time[3:-1], time[4:]])
    weight = np.ones_like(around)
    for i in range(4):
        for j in range(4):
            if i != j:
                weight[i] *= (t - around[j]) / (around[i] - around[j])
    values = np.stack([position[:-4], position[1:-3], position[3:-1], position[4:]])
    missed = position[2:-2] - np.einsum("in,ink->nk", weight, values)
    spread = np.sqrt(1.0 + np.sum(weight**2, axis=0))[:, None] * noise
    out[2:-2] = np.max(np.abs(missed) / np.maximum(FAR * spread, LEAST_M), axis=1)
    return out
