"""The segmented points of the target: X_real and X_sim of eq. 5, taken in the same way."""

from __future__ import annotations

import numpy as np

from samrl_core.errors import InputError


def eroded(mask: np.ndarray, pixels: int = 1) -> np.ndarray:
    """A boolean image (H, W) without its outermost pixels; what lies at the image border stays.

    A sensor's mask is wrong by about a pixel at its boundary, and depth there belongs to neither side.

    Raises:
        InputError: the mask is not a boolean image, or `pixels` is negative.
    """
    if mask.ndim != 2 or mask.dtype != np.bool_ or pixels < 0:
        raise InputError(f"mask {mask.shape} {mask.dtype} must be boolean (H, W), erosion {pixels} >= 0")
    inner = mask
    for _ in range(pixels):
        padded = np.pad(inner, 1, mode="edge")
        inner = (
            padded[1:-1, 1:-1] & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
        )
    return inner


def in_front(depth: np.ndarray, mask: np.ndarray, jump: float = 0.010, window: int = 2) -> np.ndarray:
    """Where a thin target's mask (H, W) has a depth [m] that can be the target's own, (H, W) bool.

    A mask that is off by a pixel shows what lies behind a thread, not the thread: what is more than `jump` [m]
    behind the nearest masked point within `window` pixels is left out, and so is what was not measured.
    """
    if depth.shape != mask.shape or mask.dtype != np.bool_:
        raise InputError(f"depth {depth.shape} and mask {mask.shape} {mask.dtype} must be of one image")
    known = mask & np.isfinite(depth)
    z = np.where(known, depth, np.inf)
    height, width = z.shape
    padded = np.pad(z, window, constant_values=np.inf)
    shifts = range(2 * window + 1)
    nearest = np.min([padded[v : v + height, u : u + width] for v in shifts for u in shifts], axis=0)
    return known & (z <= nearest + jump)


def target_cloud(xyz: np.ndarray, mask: np.ndarray, erosion: int = 1) -> np.ndarray:
    """Points (N, 3) of an image of points (H, W, 3) [m] inside the eroded mask; NaN is dropped.

    Raises:
        InputError: image and mask disagree in size.
    """
    if xyz.shape != (*mask.shape, 3):
        raise InputError(f"points {xyz.shape} and mask {mask.shape} must be of one image")
    points = xyz[eroded(mask, erosion)]
    return points[np.isfinite(points).all(axis=1)]
