"""Whether depth at the same distances changes with time, as that of a sensor does that warms up.

A factor that drifts has no one size: fitted as one, it takes in how distances happened to follow each other.
Planes that are put up anew are off by their tape each time, so that one placement counts as one value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.diagnosis.residuals.poses.image_pattern import explained_by_chance
from samrl_core.diagnosis.residuals.readings.reading_trial import ELSEWHERE

ALIKE = 0.02  # of a distance, by which two are one
BLOCKS = 24  # of time that a plane which stood still is cut into
LEAST_PLACEMENTS = 8  # from which on each is one value
DEGREE, DEPTH_DEGREE = 3, 5  # of the polynomials of time and, where distances never repeat, of depth
OF_ITS_OWN = 0.3  # of time that distances leave; less is a sweep, in which depth and time are one
EXPLAINED, CHANCE = 0.5, 1e-6  # of what depth leaves, and in noise
LARGE = 3.0  # times the stated lasting error of the depth


def find_time_pattern(recordings: Sequence[ReadingRecording]) -> str:
    """What of the depth follows from time alone, in words; else empty.

    By Fisher's test of a polynomial of time beside the depth's own errors at each distance.

    Args:
        recordings: parts of one file, fitted and held out.
    """
    time, depth, error = _by_image(recordings)
    if len(time) < 2 or not np.ptp(time):
        return ""
    placement = np.concatenate([[0], np.cumsum(np.abs(np.diff(np.log(depth))) > ALIKE)])
    distance = _distances(depth, placement)
    if placement[-1] + 1 < LEAST_PLACEMENTS:
        if placement[-1] != distance.max():
            return ""  # a few placements that repeat: what the tape was off by looks like time
        block = np.minimum((BLOCKS * (time - time[0]) / np.ptp(time)).astype(int), BLOCKS - 1)
        placement = np.unique(np.stack([placement, block], axis=1), axis=0, return_inverse=True)[1].ravel()
    groups = [placement == k for k in np.unique(placement)]
    t, d, y = (np.array([np.median(v[g]) for g in groups]) for v in (time, depth, error))
    at = np.array([distance[g][0] for g in groups])
    if 2 * (at.max() + 1) <= len(t):
        static = (at[:, None] == np.arange(at.max() + 1)).astype(float)
    else:
        static = np.vander((d - d.mean()) / max(float(d.std()), 1e-9), DEPTH_DEGREE + 1)
    since = (t - t.min()) / np.ptp(t)
    moving = np.stack([since**k for k in range(1, DEGREE + 1)], axis=1)
    freedom = len(t) - static.shape[1] - DEGREE
    if freedom < DEGREE:
        return ""
    basis = np.linalg.qr(static)[0]
    left, own = y - basis @ (basis.T @ y), moving - basis @ (basis.T @ moving)
    if np.linalg.norm(own[:, 0]) < OF_ITS_OWN * np.linalg.norm(since - since.mean()):
        return ""
    weights = np.linalg.lstsq(own, left, rcond=1e-9)[0]
    share = 1.0 - float(np.sum((left - own @ weights) ** 2)) / max(float(left @ left), 1e-300)
    curve = moving @ weights
    stated = recordings[0].tolerances
    small = np.ptp(curve) < LARGE * max(stated.depth_pattern, stated.depth_scale)
    if share < EXPLAINED or explained_by_chance(share, DEGREE, freedom) > CHANCE or small:
        return ""
    return (
        f"{recordings[0].name}: at the same distances depth changes by {100 * np.ptp(curve):.2g} % with time"
        f" alone, over {np.ptp(t):.4g} s (or readings): a sensor that warms up? Record when it is warm, or"
        " cut the recording"
    )


def _by_image(recordings: Sequence[ReadingRecording]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], distance [m] and relative error (M,) of each moment, the median of its readings, by time."""
    time = np.concatenate([r.time for r in recordings])
    depth = np.concatenate([r.reference for r in recordings])
    error = np.concatenate([r.reading for r in recordings]) / depth - 1.0
    near = np.abs(error) < ELSEWHERE  # else it is of another surface
    if not near.any():
        return np.zeros(0), np.zeros(0), np.zeros(0)
    time, depth, error = time[near], depth[near], error[near]
    moments, which = np.unique(time, return_inverse=True)
    order = np.argsort(which, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(which[order])) + 1)
    return (
        moments,
        np.array([np.median(depth[p]) for p in parts]),
        np.array([np.median(error[p]) for p in parts]),
    )


def _distances(depth: np.ndarray, placement: np.ndarray) -> np.ndarray:
    """Number (M,) of the distance that a placement stood at; those within `ALIKE` of each other are one."""
    places = np.array([np.median(depth[placement == k]) for k in range(placement[-1] + 1)])
    order = np.argsort(places)
    number = np.empty(len(places), dtype=int)
    number[order] = np.concatenate([[0], np.cumsum(np.diff(np.log(places[order])) > ALIKE)])
    return number[placement]
