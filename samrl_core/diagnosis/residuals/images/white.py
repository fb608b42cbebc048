"""Colours that end at white: all that is known of them is that they are at least that.

What one would have been is told by the other colours of its tile, as far as a surface's hue is known, and by
white, below which it was not: a Gaussian of the logarithm that is cut off (Tobin 1958, moments of a truncated
normal). What stays unknown of it is the same in all tiles of a surface, whose hue is one.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

WHITE = 0.97  # of full scale, from which on a colour is at the end of its range, blur and noise included
DARK = 0.02  # of full scale, below which nothing is said of ratios
HUE = 0.2  # standard deviation of the logarithm of one colour against the others of its surface


def without_white(expected: np.ndarray, seen: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Colours (N, 3) of tiles as they most probably would be if none ended at white, and how sure that is.

    Args:
        expected: (N, 3) of the model.
        seen: (N, 3) as recorded.
        group: (N,) surface of each tile.

    Returns:
        Colours, and the standard deviation of the logarithm of each (N, 3) by what white hides; both (N, 3).
    """
    white = seen >= WHITE
    if not white.any():
        return seen, np.zeros_like(seen)
    paint = np.maximum(expected, DARK)
    brighter = np.where(white, np.nan, np.log(np.maximum(seen, DARK) / paint))
    known = ~white.all(axis=1)
    more = np.zeros(len(seen))
    more[known] = np.nanmean(brighter[known], axis=1)
    for one in np.unique(group[~known]):
        same = (group == one) & known
        others = brighter[same if same.any() else known]  # of another surface at least the light is the same
        more[(group == one) & ~known] = np.nanmedian(others) if len(others) else 0.0
    bound = (np.log(np.maximum(seen, DARK) / paint) - more[:, None]) / HUE
    hazard = np.exp(stats.norm.logpdf(bound) - stats.norm.logsf(bound))
    mean, deviation = HUE * hazard, HUE * np.sqrt(np.clip(1.0 - hazard * (hazard - bound), 0.0, 1.0))
    whole = np.where(white, paint * np.exp(more[:, None] + mean), seen)
    return whole, np.where(white, deviation, 0.0)
