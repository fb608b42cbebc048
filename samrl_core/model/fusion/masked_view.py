"""One RGB-D image with the thing cut out of it, and the sampling of images between pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Frame
from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class MaskedView:
    """A reading, where it was taken, and where in it the thing is.

    Raises:
        InputError: images of other sizes than the camera's, an empty mask, no depth in it, or a depth that
            is neither positive nor NaN.
    """

    color: np.ndarray  # (H, W, 3) linear RGB 0..1
    depth: np.ndarray  # (H, W) along the optical axis [m], NaN where unmeasured
    mask: np.ndarray  # (H, W) bool, where the body is visible
    camera: Camera

    def __post_init__(self) -> None:
        k = self.camera.intrinsics
        shape = (k.height, k.width)
        shapes = (self.color.shape, self.depth.shape, self.mask.shape)
        if shapes != ((*shape, 3), shape, shape) or self.mask.dtype != np.bool_:
            raise InputError(
                f"colour, depth and mask have shapes {shapes}, the mask is {self.mask.dtype}; the camera's "
                f"images are {shape}, the mask must be boolean"
            )
        if not self.mask.any():
            raise InputError(
                f"mask is empty: 0 of {self.mask.size} pixels show the thing; leave the view out, or mend "
                "the segmentation"
            )
        inside = self.depth[self.mask]
        wrong = ~np.isnan(inside) & ~(np.isfinite(inside) & (inside > 0))
        if wrong.any():
            raise InputError(
                f"{int(wrong.sum())} of {inside.size} depths in the mask are not positive and finite (first "
                f"{inside[wrong][0]}); unmeasured depth must be NaN"
            )
        if np.isnan(inside).all():
            raise InputError(
                f"none of the {inside.size} pixels in the mask has a depth, all are NaN; check the depth "
                "stream and the distance to the thing, or leave the view out"
            )

    @staticmethod
    def of(frame: Frame, camera: Camera, label: int) -> MaskedView:
        """Cut the thing with `label` out of a reading.

        Raises:
            InputError: as the class.
        """
        return MaskedView(frame.color / 255.0, frame.depth.astype(np.float64), frame.mask == label, camera)

    def points(self) -> np.ndarray:
        """Measured points (N, 3) of the thing, in world [m]."""
        observed = self.mask & np.isfinite(self.depth)
        return self.camera.unproject(self.depth)[observed]

    def inside_px(self) -> np.ndarray:
        """Distance of each pixel's centre (H, W) to the mask's outline [px], negative outside the mask."""
        mask = self.mask.astype(np.uint8)
        # The transform measures to the next pixel's centre; the outline lies half a pixel before it.
        inside = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        outside = cv2.distanceTransform(1 - mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        size = float(sum(mask.shape))  # where everything is inside there is no outline, and no measure either
        return np.where(self.mask, np.minimum(inside, size) - 0.5, 0.5 - np.minimum(outside, size))


def checked_views(views: Sequence[MaskedView]) -> None:
    """Raises InputError when there is no view at all."""
    if len(views) == 0:
        raise InputError("no views to fuse; give one at least, and all sides of the body should be visible")


def corner_weights(u: np.ndarray, v: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The four pixels about each point of an image and their bilinear weights.

    Args:
        u: (N,) to the right, 0 at the outer corner of the first pixel [px].
        v: (N,) downwards [px].
        shape: height and width [px].

    Returns:
        Flat pixel numbers (4, N), clamped to the image, and weights (4, N) that add up to 1.
    """
    height, width = shape
    left, top = np.floor(u - 0.5), np.floor(v - 0.5)
    a, b = u - 0.5 - left, v - 0.5 - top
    columns = [np.clip(left + k, 0, width - 1).astype(np.int64) for k in (0, 1)]
    rows = [np.clip(top + k, 0, height - 1).astype(np.int64) for k in (0, 1)]
    pixels = np.stack([rows[j] * width + columns[i] for j in (0, 1) for i in (0, 1)])
    weights = np.stack([(b if j else 1 - b) * (a if i else 1 - a) for j in (0, 1) for i in (0, 1)])
    return pixels, weights
