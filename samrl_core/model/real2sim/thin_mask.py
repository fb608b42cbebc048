"""The mask of a thin target, mended by depth and colour.

A segmenter's boundary is off by about a pixel, which to a thread two pixels wide is all or nothing: over some
length the mask shows what lies beside the thread. Depth separates the two where it was measured, and the
colours found there separate them elsewhere.
"""

from __future__ import annotations

import numpy as np

from samrl_core.common.errors import InputError

_REACH = 2  # a mask is off by so much at most [px]
_JUMP = 0.030  # what is farther behind its neighbours is not the target; a thread may point away [m]
_ROUNDS = 4  # of growing into a hole that the segmenter left, `_REACH` at a time
_LIKE = 0.10  # largest difference of channels at which two pixels are alike, 0..1
_SHARE = 0.10  # a colour is the target's when so many of the masked pixels are like it
_MOST = 0.6
_PIXEL = 0.02  # colour difference that counts as much as a pixel of distance, 0..1


def thin_mask(color: np.ndarray, depth: np.ndarray, mask: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Which pixels show the target, (H, W) bool.

    Asked are the mask and free pixels next to it. Measured ones are the target's if nothing masked lies
    clearly in front of them and their colour is no exception among them; the others take the answer of the
    measured pixel most alike in colour and position. So on until nothing changes.

    Args:
        color: (H, W, 3), 0..1.
        depth: (H, W) [m], NaN where it was not measured, infinite where it cannot be the target's.
        mask: (H, W) bool, as segmented.
        free: (H, W) bool, pixels that no other thing claims.

    Raises:
        InputError: the images differ in size, or masks are not boolean.
    """
    if not color.shape[:2] == depth.shape == mask.shape == free.shape or mask.dtype != np.bool_:
        raise InputError(
            f"colour {color.shape}, depth {depth.shape}, masks {mask.shape}, {free.shape} {mask.dtype} must "
            "be of one image, masks boolean"
        )
    found = mask
    for _ in range(_ROUNDS):
        before, found = found, _mended(color, depth, found, free)
        if not found.any() or np.array_equal(before, found):
            break
    return found


def clear_of_others(label: np.ndarray, target: int, mask: np.ndarray) -> np.ndarray:
    """Where a thin target can be compared, (H, W) bool: not next to pixels of other things.

    Between the fingers that hold it a thread appears as a strip that may be narrower than a pixel; whether
    the segmenter finds it there does not depend on its pose. If that would leave less than `_MOST` of the
    mask, as when the thread hangs before the hand, all of the image counts.

    Args:
        label: (H, W) as segmented.
        target: its label; 0 is no thing.
        mask: of the target, mended, (H, W) bool.
    """
    other = np.where((label != 0) & (label != target) & ~mask, 0.0, 1.0)
    clear = _least(other, 1) > 0.5
    return clear if (clear & mask).sum() >= _MOST * mask.sum() else np.ones_like(clear)


def _mended(color: np.ndarray, depth: np.ndarray, mask: np.ndarray, free: np.ndarray) -> np.ndarray:
    asked = mask | (free & (_least(np.where(mask, 0.0, 1.0)) < 0.5))
    known = asked & ~np.isnan(depth)
    z = np.where(known, depth, np.inf)
    front = known & np.isfinite(z) & (z <= _least(np.where(mask, z, np.inf)) + _JUMP)
    behind = known & ~front
    sure = front & mask
    if not sure.any():
        return sure
    # A mask that is off also shows what is beside the target and no farther away, a little of it.
    every = np.argwhere(front)
    alike = np.abs(color[front][:, None] - color[sure][None]).max(axis=-1) < _LIKE
    front[tuple(every[alike.mean(axis=1) < _SHARE].T)] = False
    result = front.copy()
    unknown = np.argwhere(asked & ~known)
    if not behind.any():  # nothing to compare with: the mask is believed
        return result | (asked & ~known & mask)
    pixels = np.argwhere(front | behind)
    tint = color[tuple(unknown.T)][:, None] - color[tuple(pixels.T)][None]
    squared = np.square(tint / _PIXEL).sum(-1) + np.square(unknown[:, None] - pixels[None]).sum(-1)
    like = front[tuple(pixels[np.argmin(squared, axis=1)].T)]
    result[tuple(unknown[like].T)] = True
    return result


def _least(image: np.ndarray, reach: int = _REACH) -> np.ndarray:
    """Least value (H, W) of the neighbourhood."""
    height, width = image.shape
    padded = np.pad(image, reach, constant_values=np.inf)
    shifts = range(2 * reach + 1)
    return np.min([padded[v : v + height, u : u + width] for v in shifts for u in shifts], axis=0)
