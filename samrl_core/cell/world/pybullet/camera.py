"""TinyRenderer as an RGB-D camera: exact intrinsics, optical axes, metric depth, labels.

The only place that knows OpenGL's axes (x right, y up, z backward) and buffers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pybullet

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose

NEAR = 0.05  # [m]
FAR = 5.0  # [m]
_OPTICAL_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
_BODY_BITS = 24  # a segmentation value is body + ((link + 1) << 24), or -1


@dataclass(frozen=True, eq=False)
class Picture:
    """A perfect image."""

    color: np.ndarray  # (H, W, 3) uint8
    depth: np.ndarray  # (H, W) float64 [m], NaN where there is no surface
    mask: np.ndarray  # (H, W) uint8 label


class TinyCamera:
    """Renders one PyBullet client's world.

    Args:
        client: physics client.
        intrinsics: of the image.
        labels: label per (body, link); link -1 is the base. What is not named has label 0.
        light_direction: towards the light, in world.
        shadow: whether bodies cast shadows (twice the time).
    """

    def __init__(
        self,
        client: int,
        intrinsics: Intrinsics,
        labels: dict[tuple[int, int], int],
        light_direction: tuple[float, float, float],
        shadow: bool,
    ) -> None:
        """Build the projection and the label table once."""
        self._client = client
        self._size = (intrinsics.width, intrinsics.height)
        self._projection = projection_matrix(intrinsics)
        self._light = list(light_direction)
        self._shadow = int(shadow)
        bodies = 1 + max((body for body, _ in labels), default=0)
        links = 2 + max((link for _, link in labels), default=0)
        self._table = np.zeros((bodies + 1, links + 1), dtype=np.uint8)  # last row and column: unnamed
        for (body, link), label in labels.items():
            self._table[body, link + 1] = label

    def render(self, camera_in_world: Pose) -> Picture:
        """Picture from a pose of the optical frame."""
        view = _OPTICAL_TO_OPENGL @ camera_in_world.inverse().matrix()
        width, height = self._size
        _, _, rgba, buffer, segmentation = pybullet.getCameraImage(
            width,
            height,
            view.T.ravel().tolist(),
            self._projection,
            lightDirection=self._light,
            shadow=self._shadow,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
            physicsClientId=self._client,
        )
        color = np.ascontiguousarray(np.reshape(rgba, (height, width, 4))[..., :3], dtype=np.uint8)
        window = np.reshape(buffer, (height, width)).astype(np.float64)
        value = np.reshape(segmentation, (height, width)).astype(np.int64)
        empty = value < 0
        depth = FAR * NEAR / (FAR - (FAR - NEAR) * window)
        depth[empty] = np.nan
        rows, columns = self._table.shape
        body = np.where(empty, rows - 1, np.minimum(value & ((1 << _BODY_BITS) - 1), rows - 1))
        link = np.where(empty, columns - 1, np.minimum(value >> _BODY_BITS, columns - 1))
        return Picture(color, depth, self._table[body, link])


def projection_matrix(intrinsics: Intrinsics) -> list[float]:
    """OpenGL projection, column-major, such that our pixel centres lie at +0.5.

    TinyRenderer samples a pixel at its left edge and, its rows being flipped, at its lower edge
    (measured: silhouettes of a known mesh agree to the pixel). Half a pixel each way mends that.
    """
    k = intrinsics
    cx, cy = k.cx - 0.5, k.cy + 0.5
    p = np.zeros((4, 4))
    p[0, 0], p[0, 2] = 2 * k.fx / k.width, 1 - 2 * cx / k.width
    p[1, 1], p[1, 2] = 2 * k.fy / k.height, 2 * cy / k.height - 1
    p[2, 2], p[2, 3] = -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
    p[3, 2] = -1.0
    return p.T.ravel().tolist()
