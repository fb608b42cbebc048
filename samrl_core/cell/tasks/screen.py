"""A screen beside the goal: what makes the occluded variant of a task."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.shapes import box_mesh
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Box, Rgb
from samrl_core.common.errors import InputError

LABEL = 6  # segmentation label
COLOR: Rgb = (0.35, 0.37, 0.40)
FRICTION = 0.3  # [-]


@dataclass(frozen=True)
class Screen:
    """An upright plate that stands on the table, between the goal and some of the views of it.

    Raises:
        InputError: a length is not positive.
    """

    place: tuple[float, float]  # of its middle on the table, in world [m]
    facing: float  # azimuth of its faces' normal [rad]
    width: float  # [m]
    height: float  # [m]
    thickness: float = 0.004  # [m]

    def __post_init__(self) -> None:
        for name in ("width", "height", "thickness"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} of the screen is {getattr(self, name)} m, must be positive")

    @property
    def size(self) -> tuple[float, float, float]:
        """Edges along its own axes, x through the plate and z up [m]."""
        return self.thickness, self.width, self.height

    @property
    def body_in_world(self) -> Pose:
        """Its middle."""
        middle = np.array([*self.place, 0.5 * self.height])
        return Pose.from_rpy(middle, (0.0, 0.0, self.facing))

    def body(self, name: str) -> Body:
        """As a fixed body of a scene."""
        half = (0.5 * self.thickness, 0.5 * self.width, 0.5 * self.height)
        part = Box(half, Pose.identity())
        mesh = box_mesh(self.size, COLOR)
        return Body(name, (part,), mesh, self.body_in_world, LABEL, mass=0.0, friction=FRICTION)


def bodies_of(screens: Sequence[Screen]) -> tuple[Body, ...]:
    """Screens as bodies, `screen_0` and so on."""
    return tuple(screen.body(f"screen_{k}") for k, screen in enumerate(screens))


def beside(
    target: np.ndarray, azimuth: float, distance: float, width: float, height: float, shift: float = 0.0
) -> Screen:
    """A screen that faces a target (3,) [m].

    Args:
        target: its x and y count.
        azimuth: of the screen's plane, as seen from the target [rad].
        distance: of that plane [m].
        width: of the screen [m].
        height: of the screen [m].
        shift: of its middle along the plane, to the left as seen from the target [m].
    """
    c, s = math.cos(azimuth), math.sin(azimuth)
    x, y = target[:2] + distance * np.array([c, s]) + shift * np.array([-s, c])
    return Screen((float(x), float(y)), azimuth, width, height)


def fence(
    target: np.ndarray,
    azimuth: float,
    distance: float,
    width: float,
    height: float,
    gap: float,
    slats: Sequence[int],
    shift: float = 0.0,
) -> tuple[Screen, ...]:
    """Slats with gaps between them [m], in one plane; see `beside`. `shift` is that of slat 0 [m]."""
    step = width + gap
    return tuple(beside(target, azimuth, distance, width, height, shift + k * step) for k in slats)
