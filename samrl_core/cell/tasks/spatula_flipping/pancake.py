"""The pancake, a disc whose faces differ in colour, and the lip that it is turned over."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.tasks.shapes import box_mesh
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Box, Cylinder, Rgb, SurfaceMesh

SIDES = 32  # of the disc's mesh; physics has a true cylinder

RAW_COLOR: Rgb = (0.95, 0.85, 0.55)  # the face that is up at first
BAKED_COLOR: Rgb = (0.55, 0.28, 0.10)
RIM_COLOR: Rgb = (0.80, 0.60, 0.30)
LIP_COLOR: Rgb = (0.20, 0.20, 0.22)


def disc_mesh(radius: float, thickness: float, rounding: float) -> SurfaceMesh:
    """A disc about z with its centre at the origin: upper face raw, lower one baked, edges bevelled.

    The bevel is a chord of the rounded edge.
    """
    angle = 2 * math.pi * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    half = 0.5 * thickness
    profile = (
        (radius - rounding, -half),
        (radius, -half + rounding),
        (radius, half - rounding),
        (radius - rounding, half),
    )
    rings = [np.column_stack([r * circle, np.full(SIDES, z)]) for r, z in profile]
    vertices = np.vstack([*rings, [[0.0, 0.0, -half], [0.0, 0.0, half]]])
    last = len(profile) * SIDES
    faces: list[tuple[int, int, int]] = []
    colors: list[Rgb] = []
    for i in range(SIDES):
        j = (i + 1) % SIDES
        faces += [(last, j, i), (last + 1, last - SIDES + i, last - SIDES + j)]
        colors += [BAKED_COLOR, RAW_COLOR]
        for low in range(0, last - SIDES, SIDES):
            high = low + SIDES
            faces += [(low + i, low + j, high + j), (low + i, high + j, high + i)]
            colors += [RIM_COLOR, RIM_COLOR]
    return SurfaceMesh(vertices, np.array(faces, dtype=np.int32), np.array(colors, dtype=np.float64))


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
        disc_mesh(radius, thickness, rounding),
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
