"""Noise of an RGB-D camera on rendered images, as the paper adds it for training: on colour and on XYZ.

Depth errs along the viewing ray by z^2 c n, the first-order error of triangulation, with c the error of
disparity over focal length and baseline. Half of its variance is smooth in the image, as block matching
makes it. What is closer than a pixel to a jump of depth is lost at times.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch.nn import functional

from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class ImageNoiseSettings:
    """A stereo camera of the RealSense D435 class: 0.08 px, 447 px, 50 mm. The rest is ASSUMPTION."""

    depth: float = 0.08 / (447.0 * 0.050)  # c above [1/m]
    smooth_share: float = 0.5  # of the depth's variance
    smooth_pixels: int = 6  # width of smooth patches [px]
    jump: float = 0.010  # of depth between neighbours, where a measurement may be lost [m]
    jump_lost: float = 0.3  # how often it is
    lost: float = 0.002  # how often any pixel is
    color_read: float = 0.006  # in the dark, of 1
    color_shot: float = 8e-5  # variance per brightness, of 1
    clean_share: float = 0.3  # of images without noise, as the model's own are when the actor acts
    least: float = 0.0  # level of the others: sampled uniformly from here ...
    most: float = 2.0  # ... to there, as factor on all sizes above

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0.0:
                raise InputError(f"{name} is {value}, must be at least 0")
        if self.smooth_pixels < 1 or max(self.smooth_share, self.clean_share) > 1.0:
            raise InputError("smooth_pixels must be at least 1, smooth_share and clean_share at most 1")
        if self.least > self.most:
            raise InputError(f"least is {self.least}, must be at most {self.most}, which is most")


def noisy(
    color: torch.Tensor,
    xyz: torch.Tensor,
    depth: torch.Tensor,
    eye: torch.Tensor,
    generator: torch.Generator,
    settings: ImageNoiseSettings | None = None,
    factor: torch.Tensor | None = None,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Colour, XYZ and valid pixels of B images, each with its own noise level.

    Args:
        color: (B, H, W, 3) linear RGB, 0..1.
        xyz: (B, H, W, 3) in world [m].
        depth: (B, H, W) along the optical axis [m], inf where the pixel shows nothing.
        eye: (B, 3) camera's position in world [m].
        generator: on the images' device.
        settings: sizes.
        factor: (B,) on the size of all noise; 1 without it.

    Returns:
        Colour and XYZ like those given, and valid (B, H, W) bool.
    """
    s = settings or ImageNoiseSettings()
    count, height, width = depth.shape

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(shape, generator=generator, device=color.device, dtype=color.dtype)

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand(shape, generator=generator, device=color.device, dtype=color.dtype)

    level = s.least + (s.most - s.least) * uniform(count)
    level = level * (uniform(count) >= s.clean_share)
    if factor is not None:
        level = level * factor.to(level)
    size = level[:, None, None]
    spread = (s.color_read**2 + s.color_shot * color.clamp(0.0, 1.0)).sqrt()
    painted = (color + size[..., None] * spread * normal(*color.shape)).clamp(0.0, 1.0)

    patches = normal(count, 1, height // s.smooth_pixels + 2, width // s.smooth_pixels + 2)
    smooth = functional.interpolate(patches, size=(height, width), mode="bilinear", align_corners=True)[:, 0]
    smooth = smooth * (9.0 / 4.0) ** 0.5  # bilinear weights leave 4/9 of the variance on average
    error = (1.0 - s.smooth_share) ** 0.5 * normal(*depth.shape) + s.smooth_share**0.5 * smooth
    there = torch.isfinite(depth)
    z = torch.where(there, depth, torch.zeros_like(depth)).to(color.dtype)
    # Along the ray, a point moves by dz / z of its distance from the camera.
    points = xyz + (size * s.depth * z * error)[..., None] * (xyz - eye.to(xyz)[:, None, None])

    chance = torch.where(_jumps(z, s.jump), s.jump_lost, s.lost)
    valid = there & (uniform(*depth.shape) >= chance * size.clamp(max=1.0))
    return painted, points, valid


def _jumps(z: torch.Tensor, jump: float) -> torch.Tensor:
    """Pixels beside a neighbour whose depth differs by more than `jump` [m]."""
    found = torch.zeros_like(z, dtype=torch.bool)
    down = (z[:, 1:] - z[:, :-1]).abs() > jump
    right = (z[:, :, 1:] - z[:, :, :-1]).abs() > jump
    found[:, 1:] |= down
    found[:, :-1] |= down
    found[:, :, 1:] |= right
    found[:, :, :-1] |= right
    return found
