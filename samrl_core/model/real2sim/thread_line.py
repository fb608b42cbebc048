"""What an image says of a thread some pixels wide: where its line runs, and where it ends.

Differences of rendered images, which `view_information` takes, are coarse for such a line: one sample of a
pixel more or less passes for something that the image tells, and the way along the view, which an outline
does not show, seems to be known to millimetres. Here the line's points and their motion are exact: across
the line the middle of what it covers counts, along it the loose end alone. What is left open stays with the
belief.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.model.real2sim.target_cloud import eroded
from samrl_core.model.real2sim.target_renderer import TargetRenderer

_STEP = 0.25  # between places that are asked [px]
_HOLE = 2.5  # the longest hole that is not taken for the thread's end [px]
_COVERED = 0.4  # a pixel of which less is covered lies beyond the end [-]
_FAINT = 0.15  # less is noise of the colours [-]
_LEAST = 0.4  # width of a line that is seen [px]
_SHOWN = 2  # the model's image of the thread is trusted to so much [px]
_BACK = 8.0  # so far before the believed end a shorter thread may end [px]


@dataclass(frozen=True)
class LineNoise:
    """Errors of a line by its colours, standard deviations, with those of lens and drawing."""

    across: float = 0.3  # of its middle at one place [px]
    shared_by: float = 5.0  # so much of its length errs together [px]
    end: float = 0.6  # of its end, along it [px]
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
    cover: np.ndarray,
    shown: np.ndarray,
    noise: LineNoise,
    resolution: float = 1.0,
) -> LineEquations:
    """What an image says about a thread at values (Q,).

    Args:
        renderer: of the thread.
        values: where to linearise.
        cover: (H, W) share of each pixel that is the thread, as it is seen, 0..1; of a view that is only
            considered, what `shown` says.
        shown: (H, W) bool, the thread as the model shows it there: what is hidden says nothing.
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
    hit = _sampled(cover, pixels[:, None] + offsets[:, None] * normal[:, None])  # (N, M)
    hit = np.maximum(hit - _FAINT, 0.0)
    bare = _sampled((~eroded(~shown, _SHOWN)).astype(np.float64), pixels)
    seen = (hit.sum(axis=1) * _STEP > _LEAST * resolution) & (bare > 0.5)
    beside = np.where(seen, (hit * offsets).sum(axis=1) / np.maximum(hit.sum(axis=1), 1e-9), 0.0)  # [px]
    across = np.einsum("nc,ncq->nq", normal, motion)
    weight = seen * length / (noise.shared_by * noise.across**2 * resolution**3)
    size = np.abs(beside) / (noise.across * resolution)
    robust = weight * np.minimum(1.0, noise.outlier / np.maximum(size, 1e-12))

    information = np.einsum("nq,n,nr->qr", across, weight, across)
    matrix = np.einsum("nq,n,nr->qr", across, robust, across)
    gradient = np.einsum("nq,n,n->q", across, robust, beside)
    if seen.any() and bare[-1] > 0.5:
        end, missing = tangent[-1] @ motion[-1], _end_beyond(renderer, points, pixels, tangent[-1], cover)
        if np.isfinite(missing):
            weight_end = 1.0 / (noise.end * resolution) ** 2
            huber = min(1.0, noise.outlier * noise.end * resolution / max(abs(missing), 1e-12))
            information = information + weight_end * np.outer(end, end)
            matrix = matrix + huber * weight_end * np.outer(end, end)
            gradient = gradient + huber * weight_end * missing * end
    return LineEquations(matrix, gradient, information, int(seen.sum()))


def _end_beyond(
    renderer: TargetRenderer, points: np.ndarray, pixels: np.ndarray, tangent: np.ndarray, cover: np.ndarray
) -> float:
    """How far the thread goes on beyond the believed end along the line, or stops before [px]; NaN unseen."""
    last = float(np.linalg.norm(pixels[-1] - pixels[-2]))
    # Points stand every fifth of a link, the end half a step on; a round end is its radius longer.
    end = pixels[-1] + 0.5 * last * tangent
    depth = float(renderer.camera.camera_in_world.inverse().apply(points[-1])[2])
    radius = renderer.thickness() * renderer.camera.intrinsics.fx / depth
    along = np.arange(-_BACK, _BACK + 0.5 * _STEP, _STEP)
    side = np.array([-tangent[1], tangent[0]])
    places = end + along[:, None] * tangent
    beside = [_sampled(cover, places + aside * side) for aside in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    hit = np.max(beside, axis=0) > _COVERED
    if not hit.any():
        return float("nan")
    found = along[hit]
    gaps = np.flatnonzero(np.diff(found) > _HOLE)
    final = found[int(gaps[0])] if len(gaps) else found[-1]
    return float(final - radius)


def _sampled(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    """An image (H, W) at places (..., 2) [px], linear between the pixels' middles; 0 outside."""
    height, width = image.shape
    padded = np.pad(image, 1)
    u, v = np.moveaxis(places, -1, 0)
    u, v = np.clip(u + 0.5, 0.0, width + 0.999), np.clip(v + 0.5, 0.0, height + 0.999)
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    across, down = u - column, v - row
    upper = (1.0 - across) * padded[row, column] + across * padded[row, column + 1]
    lower = (1.0 - across) * padded[row + 1, column] + across * padded[row + 1, column + 1]
    return (1.0 - down) * upper + down * lower
