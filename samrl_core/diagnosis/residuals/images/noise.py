"""Noise of tiles, from what a recording itself leaves when everything that moves tiles may be off."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from samrl_core.diagnosis.residuals.images.rows import Rows
from samrl_core.diagnosis.residuals.poses.noise import ROBUST

ROUNDS = 8
HALVINGS = 50
TAIL = 2.0  # standard deviations beyond which a tile counts as much as that
APART = 5.0  # standard deviations beyond which a tile shows something that the model does not know
# Standard deviations of what the noise estimate lets be off: beyond the catalogue's ranges.
FREE = {
    "hand_eye": 0.02, "base": 0.02, "camera_zeros": 0.01, "camera_late": 0.1, "tool_zeros": 0.01,
    "tool_late": 0.1, "held": 0.02, "object": 0.1, "object_scale": 0.1, "focal": 0.03, "centre": 0.03,
    "radial": 0.2, "tangential": 0.01, "depth_scale": 0.05, "depth_offset": 0.03, "depth_shift": 0.03,
    "depth_bend": 0.005, "depth_nearest": 1.0,
    "depth_pattern": 0.005, "outline_bend": 0.005, "outline_object": 2.0, "outline_tip": 2.0, "light": 1.0,
    "tint": 1.0, "shading": 1.0, "paint_object": 1.0, "paint_static": 1.0, "white_object": 1.0,
    "white_static": 1.0, "depth_noise": 1.0,
}  # fmt: skip
# A tile is never known better than this: medians of quantised images scatter less than their errors last.
LEAST = {"depth": 2e-4, "mask": 0.1, "color": 0.05, "depth_noise": 0.1}

# Rows that count as one: three colours of a tile share its grain, and grain and shadows reach over neighbours
# (correlations of 0.59, 0.32 and 0.11 at one to three tiles). Left to the correlation time of all channels
# together, that halved what depth and outlines tell of camera and lens.
AS_ONE = {"color": 9.0}


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
        alike = float(np.sqrt(AS_ONE.get(channel, 1.0)))
        sigma[channel] = alike * found[channel] * r.shape * np.maximum(1.0, score / TAIL)
        apart[channel] = int(np.count_nonzero(wild))
    return found, sigma, apart


def _scale(ratio: np.ndarray) -> float:
    """Scale at which ratios, those beyond two deviations counted as two, have a mean square of one.

    So tails of any weight (mixed pixels, clutter) leave no energy beyond noise; Huber 1964's second proposal.
    """
    squared = ratio**2
    low, high = 1e-12, max(float(np.sqrt(squared.max(initial=0.0))), 1e-12)
    for _ in range(HALVINGS):  # the mean falls with the scale: there is one
        middle = float(np.sqrt(low * high))
        if np.mean(np.minimum(squared / middle**2, TAIL**2)) > 1.0:
            low = middle
        else:
            high = middle
    return high


def _leftover(rows: Mapping[str, Rows]) -> dict[str, np.ndarray]:
    """Residuals by channel after a robust fit of all columns with wide Gaussian priors."""
    names = {n: len(c) for r in rows.values() for n, c in r.columns.items()}
    design, y = [], []
    for r in rows.values():
        parts = [
            FREE[n] * r.columns[n] if n in r.columns else np.zeros((size, len(r.value)))
            for n, size in names.items()
        ]
        design.append(np.concatenate(parts).T / r.shape[:, None])
        y.append(r.value / r.shape)
    left = list(y)
    for _ in range(ROUNDS):
        normal, moment = np.eye(design[0].shape[1]), np.zeros(design[0].shape[1])
        for a, b, rest, channel in zip(design, y, left, rows, strict=True):
            scale = max(ROBUST * float(np.median(np.abs(rest))), 1e-3 * LEAST[channel])
            weight = 1.0 / (scale**2 * (1.0 + (rest / (2.5 * scale)) ** 2))
            normal += (a * weight[:, None]).T @ a
            moment += a.T @ (weight * b)
        found = np.linalg.solve(normal, moment)
        left = [b - a @ found for a, b in zip(design, y, strict=True)]
    return {c: rest * r.shape for (c, r), rest in zip(rows.items(), left, strict=True)}
