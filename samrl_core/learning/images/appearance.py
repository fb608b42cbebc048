"""Appearance of the model: colours and light sampled widely about its own, so that fitted colours are known.

At run time Real2Sim fits the colours of what it tracks; an actor must not depend on the first guesses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.model import Model


class AppearanceSource(Protocol):
    """Distribution of appearances."""

    def sample(self, model: Model, rng: np.random.Generator, count: int) -> Appearances:
        """So many appearances of the model; the same ones for the same generator."""
        ...


@dataclass(frozen=True)
class AppearanceSettings:
    """Standard deviations; those of colours are of their logarithm. ASSUMPTIONS, all of them."""

    plain_share: float = 0.2  # of appearances that are exactly the model's own
    exposure: float = 0.15  # of all colours together
    tint: float = 0.05  # of each channel of all colours
    paint: float = 0.15  # of each colour
    hue: float = 0.05  # of each channel of each colour
    light: float = 0.3  # of each component of the light's direction, which is of unit length before
    ambient: float = 0.1  # of the share of light without direction

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0.0:
                raise InputError(f"{name} is {value}, must be at least 0")

    def sample(self, model: Model, rng: np.random.Generator, count: int) -> Appearances:
        """See `AppearanceSource`."""
        return sample_appearances(model, rng, count, self)


@dataclass(frozen=True, eq=False)
class Appearances:
    """Colours and light of B images, and how noisy the camera is."""

    colors: torch.Tensor  # (B, G, 3) of the colour groups, linear RGB, as `Model.color_names`
    gain: torch.Tensor  # (B, C, 3) on each of the C fixed colours (table, tool, hand, arm)
    towards_light: torch.Tensor  # (B, 3) unit, in world
    ambient: torch.Tensor  # (B,) share of light without direction, 0..1
    noise: torch.Tensor  # (B,) factor on the size of the camera's noise, where there is any

    def rows(self, which: np.ndarray | slice) -> Appearances:
        """Those of some of the images."""
        return Appearances(*(part[which] for part in vars(self).values()))

    def to(self, device: torch.device) -> Appearances:
        """The same on a device."""
        return Appearances(*(part.to(device) for part in vars(self).values()))


def model_appearances(model: Model, count: int) -> Appearances:
    """The model's own appearance, `count` times."""
    light = np.array(model.settings.towards_light)
    return _appearances(
        np.tile(model.initial_colors(), (count, 1, 1)),
        np.ones((count, len(model.mesh.palette[0]), 3)),
        np.tile(light / np.linalg.norm(light), (count, 1)),
        np.full(count, model.settings.ambient),
        np.ones(count),
    )


def sample_appearances(
    model: Model, rng: np.random.Generator, count: int, settings: AppearanceSettings | None = None
) -> Appearances:
    """Looks about the model's own.

    Args:
        model: whose colours and light vary.
        rng: source of everything random.
        count: how many.
        settings: how widely.
    """
    s = settings or AppearanceSettings()
    own = model_appearances(model, 1)
    varied = (rng.random(count) >= s.plain_share).astype(np.float64)[:, None, None]

    def spread(number: int) -> np.ndarray:
        each = s.paint * rng.standard_normal((count, number, 1)) + s.hue * rng.standard_normal(
            (count, number, 3)
        )
        return np.exp(varied * (whole + each))

    whole = s.exposure * rng.standard_normal((count, 1, 1)) + s.tint * rng.standard_normal((count, 1, 3))
    colors = np.clip(own.colors.numpy() * spread(own.colors.shape[1]), 0.0, 1.0)
    gain = spread(own.gain.shape[1])
    light = own.towards_light.numpy() + varied[:, 0] * s.light * rng.standard_normal((count, 3))
    light /= np.maximum(np.linalg.norm(light, axis=1, keepdims=True), 1e-6)
    ambient = own.ambient.numpy() + varied[:, 0, 0] * s.ambient * rng.standard_normal(count)
    return _appearances(colors, gain, light, np.clip(ambient, 0.05, 0.95), np.ones(count))


def appearances_at(model: Model, rng: np.random.Generator, points: AppearancePoints) -> Appearances:
    """Appearances at given points; each colour's own deviation, within its size, is sampled.

    Args:
        model: whose colours and light vary.
        rng: source of everything random.
        points: N of them.
    """
    own, count = model_appearances(model, 1), len(points.exposure)

    def painted(number: int) -> np.ndarray:
        each = points.paint[:, None, None] * rng.standard_normal((count, number, 3))
        return np.exp(points.exposure[:, None, None] + each)

    colors = np.clip(own.colors.numpy() * painted(own.colors.shape[1]), 0.0, 1.0)
    gain = painted(own.gain.shape[1])
    light = own.towards_light.numpy() + points.light
    light /= np.maximum(np.linalg.norm(light, axis=1, keepdims=True), 1e-6)
    return _appearances(colors, gain, light, points.ambient, points.noise)


@dataclass(frozen=True, eq=False)
class AppearancePoints:
    """What N appearances are, but for the paint."""

    exposure: np.ndarray  # (N,) logarithm of a gain on all colours
    paint: np.ndarray  # (N,) standard deviation of the logarithm of each channel of each colour
    light: np.ndarray  # (N, 3) added to the unit vector towards the light, in world
    ambient: np.ndarray  # (N,) share of light without direction, 0..1
    noise: np.ndarray  # (N,) factor on the size of the camera's noise


def _appearances(*parts: np.ndarray) -> Appearances:
    return Appearances(*(torch.from_numpy(np.asarray(part, dtype=np.float64)) for part in parts))
