"""What an image says of a thread some pixels wide: where its line runs, and where it ends.

Differences of rendered images, which `view_information` takes, are coarse for such a line: one sample of a
pixel more or less passes for something that the image tells, and the way along the view, which an outline
does not show, seems to be known to millimetres. Here the line's points and their motion are exact: across the
line the middle of the mask counts, along it the loose end alone. What is left open stays with the belief.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.model.real2sim.target_renderer import TargetRenderer

_STEP = 0.25  # between places that are asked [px]
_HOLE = 2.5  # a mask's longest hole that is not taken for the thread's end [px]
_BACK = 8.0  # so far before the believed end a shorter thread may end [px]


@dataclass(frozen=True)
class LineNoise:
    """Errors of a segmented line, standard deviations. Checked by `tests/model/real2sim/test_part_fit.py`."""

    across: float = 1.0  # of its middle at one place, from both of its boundaries [px]
    shared_by: float = 8.0  # so much of its length errs together [px]
    end: float = 1.5  # of its end, along it [px]
    reach: float = 4.0  # what is farther beside the believed line is not it [px]
    outlier: float = 2.0  # beyond so many deviations only linearly (Huber 1964)


@dataclass(frozen=True, eq=False)
class LineEquations:
    """Least squares of one image, linear in the values."""

    normal: np.ndarray  # (Q, Q) [1/unit2]
    gradient: np.ndarray  # (Q,) right side [1/unit]
    information: np.ndarray  # (Q, Q) `normal` without outliers' weights
    seen: int  # places of the line


def line_equations(
    renderer: TargetRenderer,
    values: np.ndarray,
    mask: np.ndarray,
    noise: LineNoise,
    resolution: float = 1.0,
) -> LineEquations:
    """What a mask says about a thread at values (Q,).

    Args:
        renderer: of the thread.
        values: where to linearise.
        mask: (H, W) bool, the thread as it is seen; its own rendered mask gives the information of a view.
        noise: of the line, in pixels of the real image.
        resolution: pixels of this image per pixel of the real one, along a side.
    """
    points = renderer.line(values)  # (N, 3), the last one before the loose end
    motion = renderer.pixel_motion(points, renderer.motion(values, points))  # (N, 2, Q)
    pixels = renderer.camera.project(points)[:, :2]
    way = np.gradient(pixels, axis=0)  # (N, 2)
    length = np.linalg.norm(way, axis=1)
    tangent = way / np.maximum(length, 1e-9)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)

    reach = noise.reach * resolution
    offsets = np.arange(-reach, reach + 0.5 * _STEP, _STEP)
    hit = _inside(mask, pixels[:, None] + offsets[:, None] * normal[:, None])  # (N, M)
    seen = hit.any(axis=1)
    beside = np.where(seen, (hit * offsets).sum(axis=1) / np.maximum(hit.sum(axis=1), 1), 0.0)  # [px]
    across = np.einsum("nc,ncq->nq", normal, motion)
    weight = seen * length / (noise.shared_by * noise.across**2 * resolution**3)
    size = np.abs(beside) / (noise.across * resolution)
    robust = weight * np.minimum(1.0, noise.outlier / np.maximum(size, 1e-12))

    information = np.einsum("nq,n,nr->qr", across, weight, across)
    matrix = np.einsum("nq,n,nr->qr", across, robust, across)
    gradient = np.einsum("nq,n,n->q", across, robust, beside)
    if seen.any():
        end, missing = tangent[-1] @ motion[-1], _end_beyond(renderer, points, pixels, tangent[-1], mask)
        if np.isfinite(missing):
            weight_end = 1.0 / (noise.end * resolution) ** 2
            huber = min(1.0, noise.outlier * noise.end * resolution / max(abs(missing), 1e-12))
            information = information + weight_end * np.outer(end, end)
            matrix = matrix + huber * weight_end * np.outer(end, end)
            gradient = gradient + huber * weight_end * missing * end
    return LineEquations(matrix, gradient, information, int(seen.sum()))


def _end_beyond(
    renderer: TargetRenderer, points: np.ndarray, pixels: np.ndarray, tangent: np.ndarray, mask: np.ndarray
) -> float:
    """How far the mask goes on beyond the believed end along the line, or stops before [px]; NaN unseen."""
    last = float(np.linalg.norm(pixels[-1] - pixels[-2]))
    # Points stand every fifth of a link, the end half a step on; a round end is its radius longer.
    end = pixels[-1] + 0.5 * last * tangent
    depth = float(renderer.camera.camera_in_world.inverse().apply(points[-1])[2])
    radius = renderer.thickness() * renderer.camera.intrinsics.fx / depth
    along = np.arange(-_BACK, _BACK + 0.5 * _STEP, _STEP)
    side = np.array([-tangent[1], tangent[0]])
    places = end + along[:, None] * tangent
    hit = np.any([_inside(mask, places + aside * side) for aside in (-1.0, 0.0, 1.0)], axis=0)
    if not hit.any():
        return float("nan")
    found = along[hit]
    gaps = np.flatnonzero(np.diff(found) > _HOLE)
    final = found[int(gaps[0])] if len(gaps) else found[-1]
    return float(final - radius)


def _inside(mask: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Whether places (..., 2) [px] lie in a mask (H, W)."""
    height, width = mask.shape
    column, row = np.moveaxis(np.floor(places).astype(int), -1, 0)
    framed = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return framed & mask[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
