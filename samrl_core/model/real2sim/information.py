"""How well an image pins the parameters down: Fisher information through the renderer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.target_cloud import eroded
from samrl_core.model.rendering.window import Window


@dataclass(frozen=True)
class ImageNoise:
    """What is believed of the errors of an image. All figures are ASSUMPTION, checked against the spread of
    estimates in the simulated cell (tests/real2sim)."""

    color: float = 0.06  # shading that the model does not know, per pixel and channel, 0..1
    edge: float = 0.7  # error of a segmentation boundary, and of a jump in depth [px]
    inner_edge: float = 0.35  # error of an edge between colours inside the target [px]
    depth: float = 0.003  # at 1 m, growing with the square of the distance (stereo) [m]
    # Neighbouring pixels err together (a mask boundary is one curve, not independent samples), so their
    # information is counted once per so many pixels.
    shared_by: float = 5.0  # [px]
    # A thread's pixels err together over longer pieces: as it is rendered, and both of its edges at once.
    thin_shared_by: float = 15.0  # [px]
    # Error of calibration and encoders: the whole image is off by this much. It does not average out over
    # the pixels of a view.
    registration: float = 0.10  # [px]


@dataclass(frozen=True, eq=False)
class TargetImage:
    """The part of a rendered image that is compared (eqs. 4 and 5)."""

    color: np.ndarray  # (H, W, 3) coverage x colour, 0..1
    depth: np.ndarray  # (H, W) [m], of the target where it covers a pixel
    mask: np.ndarray  # (H, W) bool, target covers more than half of the pixel
    rim: int = 1  # at the mask's boundary depth is not compared; 0 for targets that are all boundary [px]


@dataclass(frozen=True, eq=False)
class ViewInformation:
    """Information of one view, and the linear model that it came from."""

    matrix: np.ndarray  # (P, P) inverse of the covariance that this view alone would give [1/unit2]
    pixels: int  # target pixels in the image
    near: np.ndarray  # (H, W) bool, the K pixels with information
    inside: np.ndarray  # (H, W) bool, where depth is compared
    sensitivity: np.ndarray  # (K, 4, P) derivative of red, green, blue and depth in units of their noise
    weight: np.ndarray  # (K,)
    middle: np.ndarray  # (K, 4) image where it was linearised, in units of noise
    unit: np.ndarray  # (K, 4) noise of a channel: 0..1 and [m]


def view_information(
    render: Callable[[np.ndarray], TargetImage],
    values: np.ndarray,
    steps: np.ndarray,
    noise: ImageNoise,
    resolution: float = 1.0,
    central: bool = True,
    render_all: Callable[[np.ndarray], list[TargetImage]] | None = None,
) -> ViewInformation:
    """J^T W J by differences of images, less what an unknown shift of the image spoils.

    A pixel's variance is that of its colour and depth plus that of an edge's position times the squared
    gradient of the image there. A shift (du, dv) of the whole image, which the fit does not estimate, adds
    the error that it causes.

    Args:
        render: image of the target for parameters (P,).
        values: where to linearise (P,).
        steps: half the span of each difference (P,) [unit of the parameter]; about half a pixel's worth,
            because a rasterised edge moves in steps.
        noise: error model, in pixels of the real image.
        resolution: pixels of this image per pixel of the real one, along a side (a smaller image is faster).
        central: differences to both sides; else forward ones, which take half the renderings and are good
            enough to rank views.
        render_all: images for parameters (B, P) in one go, where that is quicker than `render` one by one.

    Raises:
        InputError: shapes disagree or a step is not positive.
    """
    v, h = np.asarray(values, dtype=np.float64), np.asarray(steps, dtype=np.float64)
    if v.ndim != 1 or h.shape != v.shape or not np.all(h > 0):
        raise InputError(f"steps {h} must be positive, one per parameter {v}")
    count = v.size
    samples = np.concatenate([v[None], v + np.diag(h), *([v - np.diag(h)] if central else [])])
    images = [render(p) for p in samples] if render_all is None else render_all(samples)
    window = _window(images)
    height, width = images[0].mask.shape
    middle, *moved = [_cut(image, window) for image in images]
    ends = list(zip(moved[:count], moved[count:] or [middle] * count, strict=True))
    span = 2 * h if central else h

    # Depth counts only well inside the target: at its boundary the sensor mixes or loses it.
    inside = eroded(middle.mask, middle.rim)
    for a, b in ends:
        inside &= a.mask & b.mask
    unit = np.full((*middle.mask.shape, 4), noise.color)
    unit[..., 3] = noise.depth * np.where(inside, middle.depth, 1.0) ** 2

    def image_gradient(axis: int) -> np.ndarray:
        depth = np.where(inside, _gradient_within(middle.depth, middle.mask, axis), 0.0)
        return np.concatenate([np.gradient(middle.color, axis=axis), depth[..., None]], axis=-1) / unit

    gradient_v, gradient_u = image_gradient(0), image_gradient(1)  # of channels of unit noise, per pixel
    columns = [(_channels(a, inside, unit) - _channels(b, inside, unit)) for a, b in ends]
    sensitivity = np.stack(columns, axis=-1) / span  # (H, W, 4, P)
    # One edge is one piece of evidence, in however many channels it shows.
    steepness = gradient_u**2 + gradient_v**2  # (H, W, 4)
    edge_error = np.where(eroded(middle.mask, 2), noise.inner_edge, noise.edge) * resolution  # [px]
    variance = 1.0 + edge_error**2 * steepness[..., :3].sum(axis=-1)
    variance += (noise.edge * resolution) ** 2 * steepness[..., 3]
    near = middle.mask | (np.abs(sensitivity).sum(axis=(-1, -2)) > 0)
    # A shift of the image by +u moves what was at u - 1 here: the gradient with the opposite sign.
    rows, shift = sensitivity[near], -np.stack([gradient_u[near], gradient_v[near]], axis=-1)
    shared_by = noise.shared_by if middle.rim else noise.thin_shared_by
    weight = 1.0 / (shared_by * resolution * variance[near])  # along edges pixels fall with the side
    information, cross = weighted_product(rows, weight, rows), weighted_product(rows, weight, shift)

    # The fit does not know of the shift, so the shift goes into the parameters as an error ("considered",
    # not estimated: Bierman 1977): dv = I^-1 J_v^T W J_shift dshift.
    bias = np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ cross
    spread = bias @ bias.T * (noise.registration * resolution) ** 2
    matrix = information @ np.linalg.inv(np.eye(count) + spread @ information)
    near_at, inside_at = window.pasted(np.stack([near, inside]), height, width)
    return ViewInformation(
        0.5 * (matrix + matrix.T),
        int(middle.mask.sum()),
        near_at,
        inside_at,
        rows,
        weight,
        _channels(middle, inside, unit)[near],
        unit[near],
    )


def _window(images: list[TargetImage]) -> Window:
    """Outside of it no image shows anything of the target; with a rim for gradients."""
    any_ = np.any([(i.color != 0).any(axis=-1) | i.mask for i in images], axis=0)
    ends: list[tuple[int, int]] = []
    for axis, size in zip((0, 1), any_.shape[::-1], strict=True):
        used = np.flatnonzero(any_.any(axis=axis))
        low, high = (int(used[0]), int(used[-1]) + 1) if used.size else (0, 1)
        ends.append((max(0, low - 3), min(size, high + 3)))
    (left, right), (top, bottom) = ends
    return Window(left, top, right, bottom)


def _cut(image: TargetImage, window: Window) -> TargetImage:
    at = window.rows, window.columns
    return TargetImage(image.color[at], image.depth[at], image.mask[at], image.rim)


def _gradient_within(depth: np.ndarray, mask: np.ndarray, axis: int) -> np.ndarray:
    """Slope of depth (H, W) [m/px] from neighbours that are target too: both, or the one there is, else 0."""
    whole = np.where(mask, depth, 0.0)
    lower, upper = np.full(whole.shape, np.nan), np.full(whole.shape, np.nan)
    step = np.where(np.diff(mask.astype(np.int8), axis=axis) == 0, np.diff(whole, axis=axis), np.nan)
    first, last = [slice(None)] * 2, [slice(None)] * 2
    first[axis], last[axis] = slice(None, -1), slice(1, None)
    upper[tuple(first)], lower[tuple(last)] = step, step
    both = 0.5 * (np.where(np.isnan(lower), upper, lower) + np.where(np.isnan(upper), lower, upper))
    return np.where(mask & np.isfinite(both), both, 0.0)


def _channels(image: TargetImage, inside: np.ndarray, unit: np.ndarray) -> np.ndarray:
    depth = np.where(inside, image.depth, 0.0)
    return np.concatenate([image.color, depth[..., None]], axis=-1) / unit


def newton_step(
    view: ViewInformation,
    real: TargetImage,
    outlier: float = 3.0,
    belief: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Change of the parameters (P,) that the linear model asks for: the noise-weighted end of eq. 7.

    Eq. 4's plain sum lets the ragged boundary of the segmentation outvote the sharp edges inside the target.
    Here each pixel counts by its noise, and beyond `outlier` standard deviations only linearly (Huber 1964).

    Args:
        view: linearised where the parameters are now.
        real: the real image cut by the real mask; depth NaN where it was not measured.
        outlier: in standard deviations of a pixel's channel.
        belief: distance from here to the mean of what was believed before (P,), and the inverse of its
            covariance (P, P); the step then goes to the likeliest point of both. Without it, directions that
            the image does not show are left alone.
    """
    normal, gradient = normal_equations(view, real, outlier)
    if belief is not None:
        home, precision = belief
        return np.linalg.solve(normal + precision, gradient + precision @ home)
    return np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ gradient


def normal_equations(
    view: ViewInformation, real: TargetImage, outlier: float = 3.0
) -> tuple[np.ndarray, np.ndarray]:
    """Matrix (P, P) and right side (P,) of the least squares that `newton_step` solves; so views add up."""
    near = view.near
    measured = (view.inside & eroded(real.mask, real.rim) & np.isfinite(real.depth))[near]
    color = real.color[near] / view.unit[:, :3]
    depth = np.where(measured, np.nan_to_num(real.depth[near]) / view.unit[:, 3], view.middle[:, 3])
    residual = np.concatenate([color, depth[:, None]], axis=-1) - view.middle  # (K, 4)
    rows = view.sensitivity.copy()
    rows[:, 3] *= measured[:, None]
    own = view.weight / view.weight.max(initial=1e-300)  # 1 / variance up to a factor
    size = np.sqrt((residual**2).sum(axis=-1) * own)
    weight = view.weight * np.minimum(1.0, outlier / np.maximum(size, 1e-12))
    normal = weighted_product(rows, weight, rows)
    return normal, np.einsum("kci,k,kc->i", rows, weight, residual)


def weighted_product(rows: np.ndarray, weight: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Sum over k and c of rows (K, C, P), weight (K,) and others (K, C, Q), as (P, Q).

    K is a number of pixels, another one in each image. `numpy.einsum` with `optimize` keeps what it works out
    for each new shape, thousands of them.
    """
    weighted = (rows * weight[:, None, None]).reshape(-1, rows.shape[-1])
    return weighted.T @ others.reshape(-1, others.shape[-1])


def fused(
    mean: np.ndarray, covariance: np.ndarray, fit: np.ndarray, information: np.ndarray, surprise: float
) -> tuple[np.ndarray, np.ndarray]:
    """A Gaussian belief (P,), (P, P) updated by a fit (P,) with its information (P, P).

    When the fit is further from the mean than both covariances explain (squared Mahalanobis distance above
    `surprise` per parameter), the belief is widened until it is not: an image counts more than a memory.

    Raises:
        InputError: the covariance is not positive definite.
    """
    widened = widened_belief(mean, covariance, fit, information, surprise)
    posterior = np.linalg.inv(np.linalg.inv(widened) + information)
    return mean + posterior @ information @ (fit - mean), 0.5 * (posterior + posterior.T)


def widened_belief(
    mean: np.ndarray, covariance: np.ndarray, fit: np.ndarray, information: np.ndarray, surprise: float
) -> np.ndarray:
    """The covariance (P, P), larger where a fit surprises (`fused`).

    Raises:
        InputError: the covariance is not positive definite.
    """
    eigenvalues = np.linalg.eigvalsh(covariance)
    if not eigenvalues.min() > 0:
        raise InputError(f"covariance has eigenvalues {eigenvalues}, must be positive definite")
    offset = fit - mean
    # Covariance of the offset; in directions that the image does not show, the fit has no information.
    gain = covariance @ np.linalg.inv(np.eye(mean.size) + information @ covariance) @ information
    spread = information - information @ gain  # (C + I^-1)^-1 without inverting a singular I
    distance = float(offset @ spread @ offset) / mean.size
    return covariance * max(1.0, distance / surprise)
