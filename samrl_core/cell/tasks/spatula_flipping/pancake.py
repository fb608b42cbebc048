"""The pancake, a disc whose faces differ in colour, and the lip that it is turned over."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.tasks.shapes import DiscColors, box_mesh, disc_mesh
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Box, Cylinder, Rgb

RAW_COLOR: Rgb = (0.95, 0.85, 0.55)  # the face that is up at first
BAKED_COLOR: Rgb = (0.55, 0.28, 0.10)
RIM_COLOR: Rgb = (0.80, 0.60, 0.30)
PAINT = DiscColors(RAW_COLOR, BAKED_COLOR, RIM_COLOR)
LIP_COLOR: Rgb = (0.20, 0.20, 0.22)


def pancake_body(
    name: str,
    radius: float,
    thickness: float,
    rounding: float,
    mass: float,
    body_in_world: Pose,
    label: int,
    friction: float,
) -> Body:
    """A movable solid cylinder with rounded edges. Lengths [m], mass [kg]."""
    across = mass * (3 * radius**2 + thickness**2) / 12
    return Body(
        name,
        (Cylinder(radius, thickness, Pose.identity()),),
        disc_mesh(radius, thickness, rounding, PAINT),
        body_in_world,
        label,
        mass,
        friction,
        np.diag([across, across, 0.5 * mass * radius**2]),
        rounding,
    )


def lip_body(
    name: str, size: tuple[float, float, float], body_in_world: Pose, label: int, friction: float
) -> Body:
    """A fixed bar, edges `size` [m]."""
    half = (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
    return Body(
        name,
        (Box(half, Pose.identity()),),
        box_mesh(size, LIP_COLOR),
        body_in_world,
        label,
        0.0,
        friction,
    )
