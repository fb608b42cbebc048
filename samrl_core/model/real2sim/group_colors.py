"""Colours of the target's surface groups: the least of eq. 4 for a pose, and the belief after it."""

from __future__ import annotations

import numpy as np

from samrl_core.model.real2sim.information import ImageNoise
from samrl_core.model.real2sim.misfit import RealTarget
from samrl_core.model.real2sim.target_renderer import TargetRenderer

_ROUNDS = 4  # of reweighting
_FLOOR = 0.02  # residual below which a pixel weighs no more, 0..1
_TIE = 0.5  # pixels' worth by which a group keeps the colour that it had
_LEAST = 4  # pixels that must show the target, else colours stay


def fit_colors(
    renderer: TargetRenderer, real: RealTarget, values: np.ndarray, colors: np.ndarray
) -> np.ndarray:
    """Colours (G, 3), 0..1; those of groups that the image does not show stay.

    For a given pose the image is linear in the colours, so that eq. 4 is a sum of absolute residuals of
    linear equations, solved by least squares with weights 1 / |residual| (Schlossmacher 1973). Asked are
    pixels that are the target's in both images.
    """
    groups = renderer.target_groups
    shares, rest = renderer.group_shares(values, colors)
    both = real.image.mask & (shares.sum(axis=-1) > 0.5)
    if int(both.sum()) < _LEAST:
        return colors
    a, wanted = shares[both], (real.image.color - rest)[both]
    found = colors.copy()
    for channel in range(3):
        start = colors[groups, channel]
        x = start
        for _ in range(_ROUNDS):
            weight = 1.0 / np.maximum(np.abs(a @ x - wanted[:, channel]), _FLOOR)
            tie = _TIE * float(np.median(weight))
            normal = (a.T * weight) @ a + tie * np.eye(len(groups))
            x = np.linalg.solve(normal, (a.T * weight) @ wanted[:, channel] + tie * start)
        found[groups, channel] = np.clip(x, 0.0, 1.0)
    return found


def fused_colors(
    colors: np.ndarray,
    variance: np.ndarray,
    fitted: np.ndarray,
    pixels: np.ndarray,
    noise: ImageNoise,
    floor: float,
) -> tuple[np.ndarray, np.ndarray]:
    """A belief in colours updated by a fit, per group and channel.

    Args:
        colors: believed before (G, 3), 0..1.
        variance: of them (G, 3).
        fitted: (G, 3).
        pixels: how many of them showed each group (G,).
        noise: of the image.
        floor: error that no number of pixels removes (shading), 0..1.

    Returns:
        Colours (G, 3) and their variance (G, 3).
    """
    visible = (pixels > 0)[:, None]
    spread = noise.color**2 * noise.shared_by / np.maximum(pixels, 1.0)[:, None] + floor**2
    gain = np.where(visible, variance / (variance + spread), 0.0)
    # Shading changes with the next view, so a colour is never believed better than the floor.
    return colors + gain * (fitted - colors), np.maximum((1.0 - gain) * variance, floor**2)
