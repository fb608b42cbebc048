"""The true lens: where a pixel of the sensor looks, against where the nominal pinhole has it.

A pinhole image is rendered with the true focal lengths, principal point and a margin, and remapped through
Brown's distortion alone, x' = x (1 + k1 r2 + k2 r4) + 2 p1 xy + p2 (r2 + 2 x2) and so on (Brown 1966; the
model of OpenCV and of ROS's plumb_bob). Depth within a surface is that of the pixel's own ray, as a sensor
measures it: taken from the nearest pixel it would not move at all where the lens is off by less than half of
one, and at once by a whole one where it is off by more. At edges, where nobody mixes two surfaces, it is that
of the nearest pixel, as labels are everywhere.
"""

from __future__ import annotations

import cv2
import numpy as np

from samrl_core.cell.instance.optics import Optics
from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError

EDGE = 0.01  # difference of depth between neighbours that is an edge [m]
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
        pixels = rays * focal + centre
        size = size.astype(int)
        before = np.maximum(np.ceil(1.0 - pixels.min(axis=(0, 1))), 0.0)
        after = np.maximum(np.ceil(1.0 + pixels.max(axis=(0, 1))) - size, 0.0)
        if not np.isfinite(pixels).all() or (np.maximum(before, after) > MOST_MARGIN * size).any():
            raise InputError(
                f"lens with focal errors {optics.focal}, distortion {coefficients} looks far outside "
                f"the image; scale the group optics down"
            )
        before, after = before.astype(int), after.astype(int)
        width, height = (size + before + after).tolist()
        fx, fy, cx, cy = *focal.tolist(), *(centre + before).tolist()
        self.ideal = Intrinsics(width, height, fx, fy, cx, cy)
        # cv2 counts from the middle of the first pixel.
        x, y = np.moveaxis(pixels + before - 0.5, -1, 0).astype(np.float32)
        self._x, self._y = np.ascontiguousarray(x), np.ascontiguousarray(y)
        self._column = np.clip(np.rint(self._x), 0, width - 1).astype(np.intp)
        self._row = np.clip(np.rint(self._y), 0, height - 1).astype(np.intp)
        column = np.clip(np.floor(self._x).astype(np.intp), 0, width - 2)
        row = np.clip(np.floor(self._y).astype(np.intp), 0, height - 2)
        right, below = self._x - column, self._y - row
        # The four pixels around each place, by their numbers in the image, and what each weighs there.
        self._corners = (row * width + column) + np.array([0, 1, width, width + 1])[:, None, None]
        self._shares = np.stack(
            [(1 - below) * (1 - right), (1 - below) * right, below * (1 - right), below * right]
        )

    def color(self, ideal: np.ndarray) -> np.ndarray:
        """Colours (H, W, 3) of an ideal image, between its pixels, in its type."""
        return cv2.remap(ideal, self._x, self._y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    def nearest(self, ideal: np.ndarray) -> np.ndarray:
        """Labels (H, W), which no one mixes."""
        return ideal[self._row, self._column]

    def depth(self, ideal: np.ndarray) -> np.ndarray:
        """Depths (H, W) of an ideal image [m], between its pixels; NaN where there is none.

        Between four pixels of one surface the inverse of depth is linear: exact for a plane.
        """
        corners = np.ascontiguousarray(ideal).ravel()[self._corners]
        between = 1.0 / np.sum(self._shares / corners, axis=0)
        one_surface = np.ptp(corners, axis=0) < EDGE
        return np.where(one_surface, between, self.nearest(ideal))
