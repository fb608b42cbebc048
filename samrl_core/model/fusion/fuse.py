"""RGB-D images from known poses to one closed coloured mesh."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

from samrl_core.common.errors import InputError
from samrl_core.model.fusion.masked_view import MaskedView, checked_views, corner_weights
from samrl_core.model.fusion.volume import Grid, Volume, integrate

_OUTLINE_ERROR = 1.5  # a segmenter's outline errs by about this at most [px]
_DISSENT = 0.25  # share of the views that may not agree that a point is the thing's
_CLEAR = 0.005  # of the truncation; the surface keeps away from voxel centres by some micrometres


@dataclass(frozen=True)
class FusionSettings:
    """Resolution and region.

    Raises:
        InputError: a length is not positive, or the truncation is below two voxels.
    """

    voxel_size: float = 0.0015  # [m]
    # Ten standard deviations of depth at 0.4 m, 2.5 pixels. Measured on the three tasks' bodies: 3.5 mm lets
    # outlines of thin parts shrink by half a millimetre more, 7 mm is no better.
    truncation: float = 0.006  # [m]
    floor_height: float = 0.0  # the table's top in world; -inf for a thing that stands nowhere [m]
    max_voxels: int = 8_000_000  # 60 bytes each

    def __post_init__(self) -> None:
        if not (0 < self.voxel_size < math.inf and 2 * self.voxel_size <= self.truncation < math.inf):
            raise InputError(
                f"voxels of {self.voxel_size} m with truncation {self.truncation} m: sizes must be positive, "
                "the truncation at least two voxels"
            )


@dataclass(frozen=True, eq=False)
class FusedMesh:
    """A closed surface in world, wound outwards, coloured at its vertices."""

    vertices: np.ndarray  # (V, 3) in world [m]
    faces: np.ndarray  # (F, 3) int32
    color: np.ndarray  # (V, 3) linear RGB 0..1; of an unobserved vertex, that of the nearest observed one
    observed: np.ndarray  # (V,) bool; elsewhere the surface is a guess that closes it
    dropped_faces: int  # of specks apart from the largest surface


def fuse(views: Sequence[MaskedView], settings: FusionSettings | None = None) -> FusedMesh:
    """Fuses views of one thing at rest.

    Args:
        views: masked RGB-D images with their cameras' poses.
        settings: resolution and floor; None for the defaults.

    Raises:
        InputError: no views, masks and poses that contradict each other, a camera inside the thing, more
            voxels than allowed, or no surface in the evidence.
    """
    s = settings or FusionSettings()
    checked_views(views)
    volume = integrate(views, _grid(views, s), s.truncation, s.floor_height)
    return _surface(volume)


def _grid(views: Sequence[MaskedView], s: FusionSettings) -> Grid:
    points = _agreed_points(views)
    low, high = points.min(axis=0), points.max(axis=0)
    for number, view in enumerate(views):
        eye = view.camera.camera_in_world.position
        if ((eye > low) & (eye < high)).all():
            raise InputError(
                f"the camera of view {number} at {np.round(eye, 4)} m is inside the thing, which reaches "
                f"from {np.round(low, 4)} to {np.round(high, 4)} m; leave the view out, or mend its pose"
            )
    margin = s.truncation + 2 * s.voxel_size
    low, high = low - margin, high + margin
    low[2] = max(low[2], s.floor_height - 2 * s.voxel_size)
    shape = tuple(int(n) for n in np.ceil((high - low) / s.voxel_size).astype(int) + 1)
    if math.prod(shape) > s.max_voxels:
        needed = s.voxel_size * (math.prod(shape) / s.max_voxels) ** (1 / 3)
        raise InputError(
            f"{shape[0]} x {shape[1]} x {shape[2]} voxels of {s.voxel_size} m are {math.prod(shape)}, the "
            f"limit is {s.max_voxels}; take voxels of {needed:.2g} m, or raise max_voxels"
        )
    return Grid((float(low[0]), float(low[1]), float(low[2])), (shape[0], shape[1], shape[2]), s.voxel_size)


def _agreed_points(views: Sequence[MaskedView]) -> np.ndarray:
    """Measured points (N, 3) [m] that the masks of the other views do not contradict.

    A mask that is a pixel too large catches the far background, which would blow up the grid.
    """
    chosen, total = [], 0
    inside = [view.inside_px().reshape(-1) for view in views]
    whole = [not _touches_border(view.mask) for view in views]
    for view in views:
        points = view.points()
        total += len(points)
        against = np.zeros(len(points))
        for other, distance, all_of_it in zip(views, inside, whole, strict=True):
            if other is view:
                continue
            k = other.camera.intrinsics
            u, v, z = other.camera.project(points).T
            framed = k.frames(u, v, z)
            u, v = np.where(framed, u, 0.0), np.where(framed, v, 0.0)
            pixels, share = corner_weights(u, v, (k.height, k.width))
            hidden = other.depth[v.astype(np.int64), u.astype(np.int64)] < z - 0.01
            elsewhere = framed & ~hidden & ((distance[pixels] * share).sum(axis=0) < -_OUTLINE_ERROR)
            against += elsewhere | ~framed if all_of_it else elsewhere
        chosen.append(points[against <= _DISSENT * (len(views) - 1)])
    points = np.concatenate(chosen)
    if len(points) < max(8, 0.5 * total):
        raise InputError(
            f"only {len(points)} of {total} measured points of the thing lie in the other views' masks, at "
            "least half must; check the cameras' poses, and that the thing did not move between the views"
        )
    return points


def _touches_border(mask: np.ndarray) -> bool:
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())


def _surface(volume: Volume) -> FusedMesh:
    grid = volume.grid
    # A border of free voxels, so that the surface is closed at the grid's sides as well.
    padded = np.pad(volume.distance, 1, constant_values=np.abs(volume.distance).max())
    if not (padded < 0).any():
        raise InputError(
            f"no voxel of {grid.shape} is inside a surface; the thing may be thinner than {grid.spacing} m "
            "voxels, or the views contradict each other"
        )
    # A crossing at a voxel's centre would put the corners of several faces into one point.
    least = _CLEAR * np.abs(volume.distance).max()
    padded = np.where(np.abs(padded) < least, np.copysign(least, padded), padded)
    found, faces, _, _ = marching_cubes(padded, 0.0, gradient_direction="descent")
    position = found - 1.0  # in voxels
    faces, dropped = _largest(faces, len(position))
    used, faces = np.unique(faces, return_inverse=True)
    position, faces = position[used], faces.reshape(-1, 3).astype(np.int32)
    weight = _sampled(volume.color_weight, position)
    observed = weight > 0
    if not observed.any():
        raise InputError(
            "no part of the surface was seen with depth and colour; the views contradict each other"
        )
    color = np.stack([_sampled(volume.color[..., k], position) for k in range(3)], axis=1)
    color[observed] /= weight[observed, None]
    vertices = np.asarray(grid.origin) + grid.spacing * position
    if not observed.all():
        color[~observed] = color[observed][KDTree(vertices[observed]).query(vertices[~observed])[1]]
    return FusedMesh(vertices, faces, color, observed, dropped)


def _sampled(values: np.ndarray, position: np.ndarray) -> np.ndarray:
    return map_coordinates(values, position.T, order=1, mode="nearest")


def _largest(faces: np.ndarray, count: int) -> tuple[np.ndarray, int]:
    """Faces of the component with the most of them, and how many were dropped."""
    i, j = np.concatenate([faces[:, :2], faces[:, 1:]]).T
    graph = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(count, count))
    of = connected_components(graph, directed=False)[1][faces[:, 0]]
    chosen = of == np.bincount(of).argmax()
    return faces[chosen], int((~chosen).sum())
