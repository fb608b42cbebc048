"""Truncated signed distances of a thing on a grid, from masked RGB-D images (Curless and Levoy 1996).

Three kinds of evidence of a voxel, each a distance within the truncation and a weight:

* the body is visible there, with depth: depth less the voxel's own. Behind the surface the weight falls
  linearly, because a thin part's other side lies there (Bylow et al., RSS 2013);
* something else is visible there, and not in front of the voxel: the voxel is free by at least its distance
  from the outline of the mask, which lets thin parts that the depth camera loses keep their outline;
* no measurement: a voxel that is behind the surface or without depth in some view and free in
  none is taken as solid, so that the surface is closed where no camera can see. So is a hollow that free
  voxels do not join to the outside: no camera can have seen inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from samrl_core.model.fusion.masked_view import MaskedView, corner_weights

_CHUNK = 500_000  # voxels at a time; bounds the memory of one view's arithmetic to some 200 MB
_COLOR_INSET = 2.0  # colour counts in full this far from the mask's outline [px]


@dataclass(frozen=True)
class Grid:
    """Voxel centres, x slowest."""

    origin: tuple[float, float, float]  # of the first voxel's centre, in world [m]
    shape: tuple[int, int, int]
    spacing: float  # [m]

    def centers(self, start: int, stop: int) -> np.ndarray:
        """Centres (N, 3) of the voxels with these flat numbers, in world [m]."""
        index = np.stack(np.unravel_index(np.arange(start, stop), self.shape), axis=1)
        return np.asarray(self.origin) + self.spacing * index


@dataclass(frozen=True, eq=False)
class Volume:
    """Fused evidence on a grid."""

    grid: Grid
    distance: np.ndarray  # (X, Y, Z) to the surface, positive outside, within the truncation [m]
    color: np.ndarray  # (X, Y, Z, 3) sum of colour times weight
    color_weight: np.ndarray  # (X, Y, Z), 0 where no camera saw the surface


@dataclass(frozen=True, eq=False)
class _Evidence:
    """Measurement of N voxels from one view."""

    distance: np.ndarray  # (N,) [m], 0 where nothing is measured
    weight: np.ndarray  # (N,)
    color: np.ndarray  # (N, 3)
    color_weight: np.ndarray  # (N,)
    hidden: np.ndarray  # (N,) bool, the body is visible, but the voxel is not measured


class _ViewEvidence:
    """Evidence of one view."""

    def __init__(self, view: MaskedView, truncation: float) -> None:
        self._camera = view.camera
        k = view.camera.intrinsics
        self._shape = (k.height, k.width)
        self._pixel = 1.0 / np.sqrt(k.fx * k.fy)  # width of a pixel at 1 m [m]
        self._truncation = truncation
        self._inside = view.inside_px().reshape(-1)
        self._color = view.color.reshape(-1, 3)
        depth, mask = view.depth.reshape(-1), view.mask.reshape(-1)
        self._own = np.where(mask, depth, np.nan)
        self._other = np.where(mask, np.nan, depth)

    def of(self, points: np.ndarray) -> _Evidence:
        """Evidence at points (N, 3) in world [m]."""
        u, v, z = self._camera.project(points).T
        framed = self._camera.intrinsics.frames(u, v, z)
        u, v, z = np.where(framed, u, 0.0), np.where(framed, v, 0.0), np.where(framed, z, 1.0)
        pixels, share = corner_weights(u, v, self._shape)
        nearest = v.astype(np.int64) * self._shape[1] + u.astype(np.int64)
        inside = (self._inside[pixels] * share).sum(axis=0)  # [px]
        own = framed & (inside > 0)
        along = self._depth(pixels, share, nearest) - z
        observed = own & (along > -self._truncation)  # False where depth is NaN
        # A pixel of something else, or of nothing, frees the voxel unless that something is in front of it.
        free = framed & ~own & ~(self._other[nearest] < z - self._truncation)
        distance = np.where(observed, along, -inside * z * self._pixel)
        distance = np.clip(distance, -self._truncation, self._truncation)
        # Depth from disparity errs with the square of the distance.
        weight = (observed | free) / z**4
        weight = weight * np.where(observed & (along < 0), 1.0 + along / self._truncation, 1.0)
        near = observed & (along < self._truncation)
        return _Evidence(
            np.where(weight > 0, distance, 0.0),
            weight,
            np.einsum("knc,kn->nc", self._color[pixels], share),
            np.where(near, weight * np.clip(inside / _COLOR_INSET, 0.0, 1.0), 0.0),
            own & ~observed,
        )

    def _depth(self, pixels: np.ndarray, share: np.ndarray, nearest: np.ndarray) -> np.ndarray:
        """Depth of the thing (N,) [m], between pixels where the surface goes on, else the pixel's own.

        Over a plane 1/z is linear in the image.
        """
        around = self._own[pixels]
        smooth = np.ptp(around, axis=0) < self._truncation  # False where any is NaN
        with np.errstate(invalid="ignore"):
            between = 1.0 / (share / around).sum(axis=0)
        return np.where(smooth, between, self._own[nearest])


def integrate(views: Sequence[MaskedView], grid: Grid, truncation: float, floor_height: float) -> Volume:
    """Weighted means of all views' evidence.

    Args:
        views: of one thing that does not move.
        grid: where.
        truncation: farther from the surface only the sign of a distance counts [m].
        floor_height: the thing stands on this plane and does not reach below it, in world [m]; -inf for none.
    """
    count = int(np.prod(grid.shape))
    distance, color, color_weight = np.empty(count), np.empty((count, 3)), np.empty(count)
    evidence = [_ViewEvidence(view, truncation) for view in views]
    for start in range(0, count, _CHUNK):
        stop = min(start + _CHUNK, count)
        points = grid.centers(start, stop)
        total, weights = np.zeros(len(points)), np.zeros(len(points))
        paint, paint_weights = np.zeros((len(points), 3)), np.zeros(len(points))
        hidden = np.zeros(len(points), dtype=bool)
        for one in evidence:
            e = one.of(points)
            total += e.weight * e.distance
            weights += e.weight
            paint += e.color_weight[:, None] * e.color
            paint_weights += e.color_weight
            hidden |= e.hidden
        unknown = np.where(hidden, -truncation, truncation)
        mean = np.where(weights > 0, total / np.where(weights > 0, weights, 1.0), unknown)
        distance[start:stop] = np.maximum(mean, np.minimum(floor_height - points[:, 2], truncation))
        color[start:stop], color_weight[start:stop] = paint, paint_weights
    shape = grid.shape
    filled = _without_hollows(distance.reshape(shape), truncation)
    return Volume(grid, filled, color.reshape(*shape, 3), color_weight.reshape(shape))


def _without_hollows(distance: np.ndarray, truncation: float) -> np.ndarray:
    free = np.empty(np.add(distance.shape, 2), dtype=np.int32)
    ndimage.label(np.pad(distance > 0, 1, constant_values=True), output=free)
    outside = free[0, 0, 0]  # of the added border
    hollow = ((free > 0) & (free != outside))[1:-1, 1:-1, 1:-1]
    return np.where(hollow, -truncation, distance)
