"""A part of an image: what is rendered where only the target matters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.types.camera import Intrinsics


@dataclass(frozen=True)
class Window:
    """Columns `left` to before `right` and rows `top` to before `bottom` of an image [px]."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def rows(self) -> slice:
        """Of the whole image."""
        return slice(self.top, self.bottom)

    @property
    def columns(self) -> slice:
        """Of the whole image."""
        return slice(self.left, self.right)

    def cut(self, intrinsics: Intrinsics) -> Intrinsics:
        """Of a camera that takes only this part of the image."""
        return replace(
            intrinsics,
            width=self.right - self.left,
            height=self.bottom - self.top,
            cx=intrinsics.cx - self.left,
            cy=intrinsics.cy - self.top,
        )

    def pasted(self, part: np.ndarray, height: int, width: int) -> np.ndarray:
        """The whole images (..., height, width, ...) of `part`, axes 1 and 2 of which are rows and columns; 0
        elsewhere.
        """
        whole = np.zeros((len(part), height, width, *part.shape[3:]), dtype=part.dtype)
        whole[:, self.rows, self.columns] = part
        return whole


def whole_image(intrinsics: Intrinsics) -> Window:
    """All of it."""
    return Window(0, 0, intrinsics.width, intrinsics.height)


def window_around(points: np.ndarray, intrinsics: Intrinsics, near: float, margin: int = 2) -> Window:
    """The smallest window that shows the points (N, 3) in camera axes [m], and a margin around them.

    It is the whole image where a point lies before the near plane [m], or none within the image.
    """
    k = intrinsics
    whole = whole_image(k)
    if not len(points) or points[:, 2].min() <= near:
        return whole
    u, v = k.fx * points[:, 0] / points[:, 2] + k.cx, k.fy * points[:, 1] / points[:, 2] + k.cy
    left, right = max(0, math.floor(u.min()) - margin), min(k.width, math.ceil(u.max()) + 1 + margin)
    top, bottom = max(0, math.floor(v.min()) - margin), min(k.height, math.ceil(v.max()) + 1 + margin)
    return Window(left, top, right, bottom) if left < right and top < bottom else whole
