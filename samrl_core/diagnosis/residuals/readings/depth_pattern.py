"""Whether depth is off at each distance in a way that no factor, offset and square follow.

A camera that times light swings with the distance, and one that stands near reads echoes. Reading by reading
that may stay below the noise; the median of what was read of a plane that stood still has far less of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.diagnosis.residuals.readings.reading_trial import ELSEWHERE, LEAST_ALIKE, SLOW

ALIKE = 1e-3  # of a distance, by which two are one
LEAST_DISTANCES = 7  # four more than the formula has numbers; one of them may be mistaken
CHANCE = 1e-6  # that noise and stated errors of the planes leave as much
LARGE = 3.0  # times the stated lasting error of the depth
BESIDE = 0.1  # of the squares of what depth is off by: less is a smaller effect beside what has a formula
PLANE_M = 1e-3  # by which a plane may stand beside where a tape says it does, half width
OF_MEDIAN = 1.2533 * 1.4826  # deviation of a median by the median absolute deviation of one value


def find_depth_pattern(recordings: Sequence[ReadingRecording]) -> str:
    """What no formula of the depth follows, in words; else empty.

    By the chi-squared test of the medians at each distance about the best (1, d, d^2), where `SLOW` readings
    count as one. One distance alone that is off was stated wrongly, and is no pattern.

    Args:
        recordings: of one sensor, fitted and held out.
    """
    depth = np.concatenate([r.reference for r in recordings])
    error = np.concatenate([r.reading for r in recordings]) - depth
    kept = np.abs(error) < ELSEWHERE * depth
    depth, error = depth[kept], error[kept]
    if not len(depth):
        return ""
    order = np.argsort(depth)
    groups = np.split(order, np.flatnonzero(np.diff(np.log(depth[order])) > ALIKE) + 1)
    groups = [g for g in groups if len(g) >= LEAST_ALIKE]
    if len(groups) < LEAST_DISTANCES:
        return ""
    at = np.array([np.median(depth[g]) for g in groups])
    off = np.array([np.median(error[g]) for g in groups])
    scatter = np.array([np.median(np.abs(error[g] - o)) for g, o in zip(groups, off, strict=True)])
    spread = OF_MEDIAN * scatter * np.sqrt(SLOW / np.array([len(g) for g in groups]))
    stated = recordings[0].tolerances
    lasting = stated.deviation * np.hypot(stated.depth_pattern * at, PLANE_M)
    sigma = np.hypot(spread, lasting)
    left = _left(at, off, sigma)
    worst = int(np.argmax(np.abs(left / sigma)))
    others = np.arange(len(at)) != worst
    within = np.abs(left[worst]) < LARGE * stated.depth_pattern * at[worst]
    beside = np.sum((left / sigma) ** 2) < BESIDE * np.sum((off / sigma) ** 2)
    if within or beside or not _is_sure(_left(at[others], off[others], sigma[others]) / sigma[others]):
        return ""
    return (
        f"at {len(at)} distances depth is off by what no factor, offset and square follow, as at"
        f" {at[worst]:.4g} m by {1e3 * left[worst]:+.2g} mm, where noise and the plane leave"
        f" {1e3 * sigma[worst]:.2g} mm"
    )


def _left(at: np.ndarray, off: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """What the best square leaves of errors (D,) [m]."""
    basis = np.vander(at, 3)
    weights = np.linalg.lstsq(basis / sigma[:, None], off / sigma, rcond=None)[0]
    return off - basis @ weights


def _is_sure(score: np.ndarray) -> bool:
    """Whether chance leaves as much, of a fit with three numbers."""
    return bool(chi2.sf(float(score @ score), len(score) - 3) < CHANCE)
