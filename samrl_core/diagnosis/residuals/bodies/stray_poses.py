"""Poses that are none of the body: detections of something else, alone or few in a row.

A pose strays where a cubic through its neighbours misses it by far, and no cubic does once it is left out. At
an impact, too, no cubic fits, but leaving a pose out does not change that: impacts stay.
"""

from __future__ import annotations

import numpy as np

from samrl_core.cell.types.body_recording import BodyTrack

MOVED = 3.0  # standard deviations, or last digits, that a body moves on while its pose is repeated
FAR = 7.0  # standard deviations
LEAST_M = 2e-3  # [m] by which a pose must be missed
LONGEST = 3  # poses in a row
CLEARLY = 2.0  # times far, from which on several in a row may stray: a weak impact lies within two poses
NEAR = 6  # poses to either side, within which a second one may stray
MOST = 0.2  # share of all poses


def held_poses(track: BodyTrack) -> np.ndarray:
    """Mask (N,) of poses that a tracker repeats to the last digit for a frame that it lost.

    A body at rest may repeat one as well, rounded as it is: it is held where the pose after it lies farther
    off than noise and the last digit.
    """
    poses = np.hstack([track.position, track.quat_xyzw]) if len(track.quat_xyzw) else track.position
    same = np.concatenate([[False], np.all(poses[1:] == poses[:-1], axis=1)])
    if not same.any():
        return np.zeros(len(track), dtype=bool)
    steps = np.abs(np.diff(track.position, axis=0))
    digit = np.min(steps, axis=0, initial=np.inf, where=steps > 0)
    digit[~np.isfinite(digit)] = 0.0
    new = np.flatnonzero(~same)
    noise = _noise(track.position[new]) if len(new) > 3 else np.zeros(3)
    # What is repeated lies between the pose that it repeats and the next new one.
    first = np.searchsorted(new, np.arange(len(track)), side="right") - 1
    after = new[np.minimum(first + 1, len(new) - 1)]
    moved = np.abs(track.position[after] - track.position) > MOVED * np.maximum(noise, digit)
    return same & np.any(moved, axis=1)


def stray_poses(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Mask (N,) of positions (N, K) that stray; none where more than `MOST` would."""
    count = len(time)
    stray = np.zeros(count, dtype=bool)
    if count < 12:
        return stray
    noise = _noise(position)
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


def _noise(position: np.ndarray) -> np.ndarray:
    """Standard deviation (K,) of positions (N, K).

    Third differences hold noise as the cubics here do, and few of them hold a stray pose.
    """
    third = np.diff(position, 3, axis=0)
    return 1.4826 * np.median(np.abs(third - np.median(third, axis=0)), axis=0) / np.sqrt(20.0)


def _smallest_run(
    time: np.ndarray, position: np.ndarray, noise: np.ndarray, kept: np.ndarray, k: int, longest: int
) -> np.ndarray | None:
    """Indices into `kept` around k whose leaving out makes their neighbours fit; None where none does.

    A second stray pose nearby spoils the cubics of the first one's neighbours: then both are left out.
    """
    for length in range(1, longest + 1):
        for first in range(k - length, k + 2):  # the worst may be a neighbour of what strays
            run = np.arange(first, first + length)
            if run[0] < 0 or run[-1] >= len(kept):
                continue
            near = np.arange(max(0, first - 4), min(len(kept), first + length + 4))
            near = kept[near[~np.isin(near, run)]]
            if len(near) >= 6 and float(np.max(_scores(time[near], position[near], noise))) < 1.0:
                return run
    return _two_apart(time, position, noise, kept, k) if longest > 1 else None


def _two_apart(
    time: np.ndarray, position: np.ndarray, noise: np.ndarray, kept: np.ndarray, k: int
) -> np.ndarray | None:
    """Two indices into `kept`, one of them k or beside it, without which all around fits; None if none do."""
    around = np.arange(max(0, k - NEAR), min(len(kept), k + NEAR + 1))
    if len(around) < 2 * NEAR:
        return None
    for first in (k, k - 1, k + 1):
        for other in around[np.abs(around - first) > 1]:
            near = kept[around[(around != first) & (around != other)]]
            if float(np.max(_scores(time[near], position[near], noise))) < 1.0:
                return np.array([first, other])
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
