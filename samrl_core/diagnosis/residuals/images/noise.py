"""Noise of tiles, from what a recording itself leaves when everything that moves tiles may be off."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from samrl_core.diagnosis.residuals.images.rows import Rows
from samrl_core.diagnosis.residuals.poses.noise import ROBUST

ROUNDS = 8
TAIL = 2.0  # standard deviations beyond which a tile counts as much as that
APART = 5.0  # standard deviations beyond which a tile shows something that the model does not know
# Standard deviations of what the noise estimate lets be off: beyond the catalogue's ranges.
FREE = {
    "hand_eye": 0.02, "base": 0.02, "camera_zeros": 0.01, "camera_late": 0.1, "tool_zeros": 0.01,
    "tool_late": 0.1, "held": 0.02, "object": 0.1, "object_scale": 0.1, "focal": 0.03, "centre": 0.03,
    "radial": 0.2, "tangential": 0.01, "depth_scale": 0.05, "depth_offset": 0.03, "depth_shift": 0.03,
    "depth_pattern": 0.005, "outline_object": 2.0, "outline_tip": 2.0, "light": 1.0, "paint_object": 1.0,
    "paint_static": 1.0, "depth_noise": 1.0,
}  # fmt: skip
# Of them, where the errors themselves are asked for. What moves points is small unless it must be; what only
# adds to depth or brightness is linear at any size, so it goes first.
LIKELY = 0.05
ADDED = frozenset({"depth_scale", "depth_offset", "light", "paint_object", "paint_static", "depth_noise"})
# A tile is never known better than this: medians of quantised images scatter less than their errors last.
LEAST = {"depth": 2e-4, "mask": 0.1, "color": 0.05, "depth_noise": 0.1}


def noise_of_rows(
    rows: Mapping[str, Rows],
    level: Mapping[str, float],
) -> tuple[dict[str, float], dict[str, np.ndarray], dict[str, int]]:
    """Levels by channel, standard deviations (N,) of each row, and how many rows stand apart.

    `level` holds what another recording of the same camera gave, or nothing. What stands apart
    counts as little as it is far off: clutter on the table is no gap of the camera.
    """
    left = _leftover(rows)
    found, sigma, apart = {}, {}, {}
    for channel, r in rows.items():
        ratio = left[channel] / r.shape
        typical = float(np.median(r.shape))
        # Another view has coarser noise, and no recording has finer noise than what was fitted.
        found[channel] = max(_scale(ratio), LEAST[channel] / typical, level.get(channel, 0.0))
        score = np.abs(ratio) / found[channel]
        wild = score > APART
        # Tails are heavy: what lies beyond two deviations counts as two.
        sigma[channel] = found[channel] * r.shape * np.maximum(1.0, score / TAIL)
        apart[channel] = int(np.count_nonzero(wild))
    return found, sigma, apart


def _scale(ratio: np.ndarray) -> float:
    """Scale at which ratios, those beyond two deviations counted as two, have a mean square of one.

    So tails of any weight (mixed pixels, clutter) leave no energy beyond noise; Huber 1964's second proposal.
    """
    found = max(ROBUST * float(np.median(np.abs(ratio))), 1e-12)
    for _ in range(ROUNDS):
        found *= float(np.sqrt(np.mean(np.minimum((ratio / found) ** 2, TAIL**2))))
    return found


def fitted_errors(rows: Mapping[str, Rows]) -> dict[str, np.ndarray]:
    """Amplitudes by name of all columns together, by the robust fit that the noise is taken from."""
    return _robust_fit(rows, LIKELY)[1]


def _leftover(rows: Mapping[str, Rows]) -> dict[str, np.ndarray]:
    """Residuals by channel after a robust fit of all columns with wide Gaussian priors."""
    return _robust_fit(rows)[0]


def _robust_fit(
    rows: Mapping[str, Rows], likely: float = 1.0
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    spread = {n: FREE[n] if n in ADDED else likely * FREE[n] for n in FREE}
    names = {n: len(c) for r in rows.values() for n, c in r.columns.items()}
    design, y = [], []
    for r in rows.values():
        parts = [
            spread[n] * r.columns[n] if n in r.columns else np.zeros((size, len(r.value)))
            for n, size in names.items()
        ]
        design.append(np.concatenate(parts).T / r.shape[:, None])
        y.append(r.value / r.shape)
    left, found = list(y), np.zeros(0)
    for _ in range(ROUNDS):
        normal, moment = np.eye(design[0].shape[1]), np.zeros(design[0].shape[1])
        for a, b, rest, channel in zip(design, y, left, rows, strict=True):
            scale = max(ROBUST * float(np.median(np.abs(rest))), 1e-3 * LEAST[channel])
            weight = 1.0 / (scale**2 * (1.0 + (rest / (2.5 * scale)) ** 2))
            normal += (a * weight[:, None]).T @ a
            moment += a.T @ (weight * b)
        found = np.linalg.solve(normal, moment)
        left = [b - a @ found for a, b in zip(design, y, strict=True)]
    amplitudes, start = {}, 0
    for n, size in names.items():
        amplitudes[n] = spread[n] * found[start : start + size]
        start += size
    return {c: rest * r.shape for (c, r), rest in zip(rows.items(), left, strict=True)}, amplitudes
