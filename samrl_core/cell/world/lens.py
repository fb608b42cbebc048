"""The true lens: where a pixel of the sensor looks, against where the nominal pinhole has it.

An ideal pinhole image is rendered with a margin and remapped through true focal lengths, principal point and
Brown's distortion, x' = x (1 + k1 r2 + k2 r4) + 2 p1 xy + p2 (r2 + 2 x2) and so on (Brown 1966; the model of
OpenCV and of ROS's plumb_bob).
"""

from __future__ import annotations

import cv2
import numpy as np

from samrl_core.cell.instance.optics import Optics
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError

MOST_MARGIN = 0.35  # of the image's size; a lens that needs more is none


class Lens:
    """Maps of one lens for one image size.

    Raises:
        InputError: the distortion is so strong that the image does not know where it looks.
    """

    def __init__(self, optics: Optics, nominal: Intrinsics) -> None:
        k = nominal
        self.optics = optics
        size = np.array([k.width, k.height])
        focal = np.array([k.fx, k.fy]) * (1.0 + optics.focal)
        centre = np.array([k.cx, k.cy]) + optics.centre * size
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        seen = np.stack([(u - centre[0]) / focal[0], (v - centre[1]) / focal[1]], axis=-1)
        matrix = np.eye(3)
        coefficients = np.array([*optics.radial, *optics.tangential])
        rays = cv2.undistortPoints(seen.reshape(-1, 1, 2), matrix, coefficients).reshape(seen.shape)
        pixels = rays * [k.fx, k.fy]  # of the ideal image, from its principal point
        reach = np.abs(pixels).max(axis=(0, 1)) + 1.5
        half = np.ceil(np.maximum(reach, 0.5 * size)).astype(int)
        if not np.isfinite(pixels).all() or (half > (0.5 + MOST_MARGIN) * size).any():
            raise InputError(
                f"lens with focal errors {optics.focal}, distortion {coefficients} looks far outside "
                f"the image; scale the group optics down"
            )
        width, height = (2 * half).tolist()
        self.ideal = Intrinsics(width, height, k.fx, k.fy, float(half[0]), float(half[1]))
        # cv2 counts from the middle of the first pixel.
        self._x = (pixels[..., 0] + half[0] - 0.5).astype(np.float32)
        self._y = (pixels[..., 1] + half[1] - 0.5).astype(np.float32)
        self._column = np.clip(np.rint(self._x), 0, width - 1).astype(np.intp)
        self._row = np.clip(np.rint(self._y), 0, height - 1).astype(np.intp)

    def color(self, ideal: np.ndarray) -> np.ndarray:
        """Colours (H, W, 3) of an ideal image, between its pixels, in its type."""
        return cv2.remap(ideal, self._x, self._y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    def nearest(self, ideal: np.ndarray) -> np.ndarray:
        """Depths or labels (H, W), which no one mixes."""
        return ideal[self._row, self._column]
