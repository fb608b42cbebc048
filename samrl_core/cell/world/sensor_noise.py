"""What separates readings from the truth: RGB-D, mask and joint sensors, all sampled from a generator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class JointSensorNoise:
    """White noise of the joint sensors. ASSUMPTION, all three: the makers publish none of them."""

    position_std: float = 1e-5  # [rad]
    velocity_std: float = 1e-3  # [rad/s]
    effort_std: float = 0.05  # [N m]

    def stack(self, joints: int) -> np.ndarray:
        """Standard deviations of position, velocity and effort, shape (3, joints)."""
        return np.repeat([[self.position_std], [self.velocity_std], [self.effort_std]], joints, axis=1)


NO_JOINT_NOISE = JointSensorNoise(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class RgbdNoise:
    """Noise of a stereo depth camera of the RealSense D435 class, of its colour image and of a segmenter.

    Depth error is sigma_z = z^2 subpixel / (focal baseline), the first-order error of triangulation.
    Baseline 50 mm and 87 deg depth field of view over 848 px are the D400 series' datasheet; the sub-pixel
    figure 0.08 is the usual one of Intel's tuning guide for textured scenes. The rest is ASSUMPTION.
    """

    baseline: float = 0.050  # [m]
    stereo_focal: float = 447.0  # at the depth imager's native 848 px, not the colour image's [px]
    subpixel: float = 0.08  # standard deviation of disparity [px]
    disparity_step: float = 1.0 / 32.0  # quantisation of disparity [px]
    correlated_share: float = 0.5  # share of the disparity's variance that is smooth in the image [-]
    correlation_length: float = 6.0  # of the smooth fields [px]
    depth_range: tuple[float, float] = (0.17, 3.0)  # NaN outside [m]
    edge_jump: float = 0.010  # depth difference of neighbours that makes an edge [m]
    edge_dropout: float = 0.5  # probability that an edge pixel has no depth [-]
    speckle: float = 0.002  # probability that any pixel has no depth [-]
    color_read: float = 1.5  # noise in the dark, of 255 [-]
    color_shot: float = 0.02  # variance per grey level, of 255 [-]
    mask_boundary: float = 0.6  # standard deviation of the boundary's place [px]
    mask_blobs: float = 0.3  # mean number of missing blobs per image [-]
    mask_blob_radius: tuple[float, float] = (1.5, 4.0)  # [px]


NO_RGBD_NOISE = RgbdNoise(
    subpixel=0.0,
    disparity_step=0.0,
    edge_dropout=0.0,
    speckle=0.0,
    color_read=0.0,
    color_shot=0.0,
    mask_boundary=0.0,
    mask_blobs=0.0,
)


class RgbdSensor:
    """Turns a perfect RGB-D image into a reading.

    Raises:
        InputError: a setting is outside its meaning.
    """

    def __init__(self, noise: RgbdNoise, intrinsics: Intrinsics) -> None:
        """Build for one image size."""
        for name in ("baseline", "stereo_focal", "correlation_length"):
            if not getattr(noise, name) > 0:
                raise InputError(f"{name} is {getattr(noise, name)}, must be positive")
        for name in ("correlated_share", "edge_dropout", "speckle"):
            if not 0.0 <= getattr(noise, name) <= 1.0:
                raise InputError(f"{name} is {getattr(noise, name)}, must lie within 0..1")
        self._noise = noise
        self._shape = (intrinsics.height, intrinsics.width)
        self._rows = _interpolation(intrinsics.height, noise.correlation_length)
        self._columns = _interpolation(intrinsics.width, noise.correlation_length)
        v, u = np.mgrid[0 : intrinsics.height, 0 : intrinsics.width].astype(np.float32)
        self._v, self._u = v, u

    def read(
        self, rng: np.random.Generator, color: np.ndarray, depth: np.ndarray, mask: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reading of a perfect image.

        Args:
            rng: source of all noise.
            color: (H, W, 3) uint8.
            depth: (H, W) [m], NaN where there is no surface.
            mask: (H, W) uint8 labels.

        Returns:
            Colour uint8, depth float32 [m] with NaN where unmeasured, mask uint8, in the same shapes.
        """
        return self._read_color(rng, color), self._read_depth(rng, depth), self._read_mask(rng, mask)

    def _smooth(self, rng: np.random.Generator) -> np.ndarray:
        """Unit-variance field of the correlation length, shape (H, W)."""
        coarse = rng.standard_normal((self._rows.shape[1], self._columns.shape[1]), dtype=np.float32)
        return self._rows @ coarse @ self._columns.T

    def _read_color(self, rng: np.random.Generator, color: np.ndarray) -> np.ndarray:
        n = self._noise
        if n.color_read == 0 and n.color_shot == 0:
            return np.array(color, dtype=np.uint8)
        grey = color.astype(np.float32)
        std = np.sqrt(n.color_read**2 + n.color_shot * grey)
        noisy = grey + std * rng.standard_normal(color.shape, dtype=np.float32)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)

    def _read_depth(self, rng: np.random.Generator, depth: np.ndarray) -> np.ndarray:
        n = self._noise
        z = depth.astype(np.float32)
        scale = n.stereo_focal * n.baseline  # disparity = scale / z [px m]
        if n.subpixel > 0 or n.disparity_step > 0:
            share = n.correlated_share
            white = rng.standard_normal(self._shape, dtype=np.float32)
            field = np.sqrt(1 - share) * white + np.sqrt(share) * self._smooth(rng)
            disparity = scale / z + n.subpixel * field
            if n.disparity_step > 0:
                disparity = np.rint(disparity / n.disparity_step) * n.disparity_step
            # The z computed from a disparity near 0 is beyond the range and dropped below.
            z = scale / np.maximum(disparity, 1e-3)
        chance = np.full(self._shape, n.speckle, dtype=np.float32)
        chance[_edges(depth, n.edge_jump)] = max(n.edge_dropout, n.speckle)
        lost = rng.random(self._shape, dtype=np.float32) < chance
        lost |= ~((z > n.depth_range[0]) & (z < n.depth_range[1]))
        return np.where(lost, np.float32(np.nan), z).astype(np.float32)

    def _read_mask(self, rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
        n = self._noise
        # Labels looked up at smoothly displaced pixels: boundaries grow here and shrink there.
        if n.mask_boundary > 0:
            v = np.rint(self._v + n.mask_boundary * self._smooth(rng)).astype(np.intp)
            u = np.rint(self._u + n.mask_boundary * self._smooth(rng)).astype(np.intp)
            np.clip(v, 0, self._shape[0] - 1, out=v)
            np.clip(u, 0, self._shape[1] - 1, out=u)
            out = mask[v, u]
        else:
            out = np.array(mask, dtype=np.uint8)
        labelled = np.flatnonzero(out)
        for _ in range(rng.poisson(n.mask_blobs) if n.mask_blobs > 0 else 0):
            if labelled.size == 0:
                break
            v0, u0 = divmod(int(rng.choice(labelled)), self._shape[1])
            radius = rng.uniform(*n.mask_blob_radius)
            out[(self._v - v0) ** 2 + (self._u - u0) ** 2 < radius**2] = 0
        return out


def _edges(depth: np.ndarray, jump: float) -> np.ndarray:
    """Pixels next to a neighbour that is farther or nearer by more than `jump` [m], or empty."""
    z = np.where(np.isfinite(depth), depth, 1e3)
    edge = np.zeros(z.shape, dtype=bool)
    down = np.abs(z[1:] - z[:-1]) > jump
    right = np.abs(z[:, 1:] - z[:, :-1]) > jump
    edge[1:] |= down
    edge[:-1] |= down
    edge[:, 1:] |= right
    edge[:, :-1] |= right
    return edge


def _interpolation(size: int, length: float) -> np.ndarray:
    """Matrix (size, knots) of linear interpolation, its rows of unit length to keep the variance."""
    place = np.arange(size) / length
    knots = int(np.floor(place[-1])) + 2
    left = np.floor(place).astype(int)
    matrix = np.zeros((size, knots))
    matrix[np.arange(size), left] = 1 - (place - left)
    matrix[np.arange(size), left + 1] = place - left
    return (matrix / np.linalg.norm(matrix, axis=1, keepdims=True)).astype(np.float32)
