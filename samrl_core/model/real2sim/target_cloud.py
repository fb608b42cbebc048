"""The segmented points of the target: X_real and X_sim of eq. 5, taken in the same way."""

from __future__ import annotations

import numpy as np

from samrl_core.common.errors import InputError


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


def target_cloud(xyz: np.ndarray, mask: np.ndarray, erosion: int = 1) -> np.ndarray:
    """Points (N, 3) of an image of points (H, W, 3) [m] inside the eroded mask; NaN is dropped.

    Raises:
        InputError: image and mask disagree in size.
    """
    if xyz.shape != (*mask.shape, 3):
        raise InputError(f"points {xyz.shape} and mask {mask.shape} must be of one image")
    points = xyz[eroded(mask, erosion)]
    return points[np.isfinite(points).all(axis=1)]
