"""Appearance of the model before any measurement, and settings of its rendering."""

from __future__ import annotations

from dataclasses import dataclass

from samrl_core.cell.types.scene import Rgb
from samrl_core.model.rendering.renderer import SUPERSAMPLE


@dataclass(frozen=True)
class ModelSettings:
    """Appearance of the model. Colours and light are ASSUMPTIONS: first guesses that Real2Sim corrects."""

    supersample: int = SUPERSAMPLE  # samples per pixel and direction
    device: str = "cpu"  # torch's name
    threads: int = 2  # that share the images of one call on a CPU
    near: float = 0.02  # near plane [m]
    ambient: float = 0.4  # share of light without direction, 0..1
    towards_light: tuple[float, float, float] = (0.5, 0.5, 1.0)  # in world
    table_color: Rgb = (0.6, 0.6, 0.6)
    hand_color: Rgb = (0.7, 0.7, 0.7)
    arm_color: Rgb = (0.85, 0.85, 0.85)
    background: Rgb = (1.0, 1.0, 1.0)
    table_center: tuple[float, float] = (0.5, 0.0)  # in world [m]
    table_size: tuple[float, float] = (0.8, 1.0)  # along world x and y [m]
    table_height: float = 0.0  # of its top in world [m]
