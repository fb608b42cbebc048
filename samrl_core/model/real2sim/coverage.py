"""How much of each pixel a part covers, by its colours near where a mask has it.

A segmenter's boundary is a pixel off, here outwards and there inwards, and over a length of several pixels
the same way: the middle of a thread's mask lies a pixel beside the thread. Colours are not. Each pixel is
taken for a mix of one of the part's colours and one of those around it, the pair that explains it best
(sampling-based matting: Wang and Cohen 2007, "Optimized color sampling for robust matting"). Boundaries that
lie inwards leave some pixels of a thread here and there, and miss its end: such a mask is followed along its
colours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.target_cloud import eroded


@dataclass(frozen=True)
class CoverageSettings:
    """Where colours are taken from, and which pairs of them tell anything."""

    reach: int = 2  # a mask is off by so much at most [px]
    around: int = 5  # beyond that, so far colours count as what lies around [px]
    least_contrast: float = 0.15  # of two colours, root of the channels' squared sum, 0..1
    salient: float = 0.6  # a thin part's colours: so much of its largest contrast, at least [-]
    unexplained: float = 0.12  # a mix farther from a pixel's colour than this says nothing, 0..1
    distance: float = 0.003  # colour difference that counts as much as a pixel of distance, 0..1
    most_samples: tuple[int, int] = (24, 160)  # of the part, and of what lies around
    # A thin part's mask with fewer pixels per row of its extent has holes, and may end before the part does.
    sparse: float = 1.25
    rounds: int = 8  # of growing such a mask along its colours, `reach` at a time
    own_around: float = 0.1  # share of what lies around such a mask that may be the part itself


def coverage(
    color: np.ndarray,
    mask: np.ndarray,
    thin: bool,
    taken: np.ndarray | None = None,
    settings: CoverageSettings | None = None,
) -> np.ndarray:
    """Share of each pixel that the part covers (H, W), 0..1; what the mask says where colours do not tell.

    Args:
        color: (H, W, 3), 0..1.
        mask: (H, W) bool, the part as it was segmented.
        thin: a part all of whose pixels may be boundary.
        taken: (H, W) bool, pixels of other things, from which no colour of the part is taken; None: none.
        settings: see there.

    Raises:
        InputError: the images differ in size, or the mask is not boolean.
    """
    if color.shape != (*mask.shape, 3) or mask.dtype != np.bool_:
        raise InputError(f"colour {color.shape} and mask {mask.shape} {mask.dtype} must be of one image")
    s = settings or CoverageSettings()
    if not (thin and _is_sparse(mask, s.sparse)):
        return _shares(color, mask, thin, taken, s, 0.0)
    free = np.ones_like(mask) if taken is None else ~taken
    found = _shares(color, mask, thin, taken, s, s.own_around)
    for _ in range(s.rounds):
        more = mask | ((found > 0.5) & free)
        if np.array_equal(more, mask):
            break
        mask, found = more, _shares(color, more, thin, taken, s, s.own_around)
    return found


def _shares(
    color: np.ndarray,
    mask: np.ndarray,
    thin: bool,
    taken: np.ndarray | None,
    s: CoverageSettings,
    own_around: float,
) -> np.ndarray:
    """`coverage` by one mask; so large a share of what lies around it may have the part's colours."""
    found = mask.astype(np.float64)
    asked = _grown(mask, s.reach)
    around = _grown(asked, s.around) & ~_grown(asked, 1)
    if not (mask.any() and around.any()):
        return found
    if thin:  # its mask may lie beside it
        inner = _grown(mask, 1) if taken is None else mask | (_grown(mask, 1) & ~taken)
    else:
        inner = eroded(mask)
    inner = inner if inner.any() else mask
    part, other = np.argwhere(inner), np.argwhere(around)
    contrast = np.sqrt(_squared(color[tuple(part.T)], color[tuple(other.T)]))
    contrast = np.quantile(contrast, own_around, axis=1) if own_around else contrast.min(axis=1)
    if thin:
        part = part[contrast >= s.salient * np.quantile(contrast, 0.9)]
        # What is missing from the mask lies around it, and is none of what is around the part.
        unlike = _squared(color[tuple(other.T)], color[tuple(part.T)]).min(axis=1) > s.least_contrast**2
        other = other[unlike]
        if not len(other):
            return found
    part, other = _some(part, s.most_samples[0]), _some(other, s.most_samples[1])
    f, b = color[tuple(part.T)], color[tuple(other.T)]
    places = np.argwhere(asked)
    c = color[tuple(places.T)]
    way = f[:, None] - b[None]  # (F, B, 3)
    length = np.square(way).sum(axis=-1)
    tells = length > s.least_contrast**2
    if not tells.any():
        return found
    share = np.einsum("fbc,pfbc->pfb", way, c[:, None, None] - b[None, None]) / np.maximum(length, 1e-9)
    share = np.clip(share, 0.0, 1.0)
    left = np.square(c[:, None, None] - b - share[..., None] * way).sum(axis=-1)  # (P, F, B)
    far = s.distance**2 * (
        np.square(places[:, None] - part).sum(axis=-1)[:, :, None]
        + np.square(places[:, None] - other).sum(axis=-1)[:, None]
    )
    cost = np.where(tells, left + far, np.inf).reshape(len(places), -1)
    best = cost.argmin(axis=1)
    rows = np.arange(len(places))
    explained = left.reshape(len(places), -1)[rows, best] < s.unexplained**2
    found[tuple(places[explained].T)] = share.reshape(len(places), -1)[rows, best][explained]
    return found


def _is_sparse(mask: np.ndarray, least: float) -> bool:
    """Whether a mask has fewer than `least` pixels for each row, or column, that it reaches over."""
    if not mask.any():
        return False
    extent = max(int(np.ptp(at)) + 1 for at in np.nonzero(mask))
    return float(mask.sum()) < least * extent


def _grown(mask: np.ndarray, pixels: int) -> np.ndarray:
    return ~eroded(~mask, pixels)


def _some(places: np.ndarray, most: int) -> np.ndarray:
    """Evenly taken from (N, 2) in the order of rows and columns."""
    return places if len(places) <= most else places[np.linspace(0, len(places) - 1, most).astype(int)]


def _squared(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Squared distances (N, M) of colours (N, 3) and (M, 3)."""
    return np.square(a[:, None] - b[None]).sum(axis=-1)
