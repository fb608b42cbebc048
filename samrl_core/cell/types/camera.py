"""Pinhole camera. Optical frame after REP-103: z forward, x right, y down; pixel centres at +0.5."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole parameters. A point (x, y, z) falls on u = fx x/z + cx, v = fy y/z + cy.

    `u` and `v` count from the outer corner of the first pixel, whose centre is (0.5, 0.5). ROS and
    OpenCV count from that centre: their cx is ours minus 0.5 (see `ros_k`).
    """

    width: int  # [px]
    height: int  # [px]
    fx: float  # [px]
    fy: float  # [px]
    cx: float  # [px]
    cy: float  # [px]

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise InputError(f"image size {self.width}x{self.height} px, must be at least 1x1")
        if not (self.fx > 0 and self.fy > 0 and math.isfinite(self.fx) and math.isfinite(self.fy)):
            raise InputError(f"focal lengths fx={self.fx}, fy={self.fy} px must be positive and finite")
        if not (math.isfinite(self.cx) and math.isfinite(self.cy)):
            raise InputError(f"principal point cx={self.cx}, cy={self.cy} px must be finite")

    @staticmethod
    def from_fov(width: int, height: int, vertical_fov_rad: float) -> Intrinsics:
        """Square pixels, centred principal point."""
        f = 0.5 * height / math.tan(0.5 * vertical_fov_rad)
        return Intrinsics(width, height, f, f, 0.5 * width, 0.5 * height)

    @property
    def ros_k(self) -> tuple[float, ...]:
        """Row-major K of sensor_msgs/CameraInfo, principal point counted from the pixel centre."""
        return (self.fx, 0.0, self.cx - 0.5, 0.0, self.fy, self.cy - 0.5, 0.0, 0.0, 1.0)

    @staticmethod
    def from_ros_k(width: int, height: int, k: tuple[float, ...]) -> Intrinsics:
        """From a CameraInfo's size and row-major K (9 numbers)."""
        if len(k) != 9:
            raise InputError(f"camera_info K has {len(k)} numbers, must be 9")
        return Intrinsics(width, height, k[0], k[4], k[2] + 0.5, k[5] + 0.5)

    def frames(self, u: np.ndarray, v: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Whether projected points (...) lie in front of the camera and within the image, (...) bool.

        Args:
            u: (...) to the right [px].
            v: (...) downwards [px].
            depth: (...) along the optical axis; may be negative [m].
        """
        return (depth > 0) & (u >= 0) & (u < self.width) & (v >= 0) & (v < self.height)


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera somewhere in the world."""

    intrinsics: Intrinsics
    camera_in_world: Pose  # optical frame

    def project(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) [m] to u, v, depth (..., 3) [px, px, m]; depth may be negative."""
        p = self.camera_in_world.inverse().apply(points)
        k = self.intrinsics
        z = p[..., 2]
        safe = np.where(np.abs(z) < 1e-9, 1e-9, z)
        return np.stack([k.fx * p[..., 0] / safe + k.cx, k.fy * p[..., 1] / safe + k.cy, z], axis=-1)

    def unproject(self, depth: np.ndarray) -> np.ndarray:
        """Depth image (H, W) [m] to world points (H, W, 3) [m]; NaN stays NaN."""
        k = self.intrinsics
        if depth.shape != (k.height, k.width):
            raise InputError(f"depth image is {depth.shape}, camera expects {(k.height, k.width)}")
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        rays = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)
        return self.camera_in_world.apply(rays * depth[..., None])
