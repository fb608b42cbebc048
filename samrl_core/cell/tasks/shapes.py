"""Shapes that several tasks build: a ring and a disc about z, a box. Meshes are closed, wound outwards."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Rgb, SurfaceMesh

SIDES = 16  # boxes of the ring; boxes, because convex meshes carry a 1 mm margin that eats the clearance
DISC_SIDES = 32  # of a disc's mesh; physics has a true cylinder


@dataclass(frozen=True)
class RingColors:
    """Colour of each kind of face."""

    top: Rgb
    side: Rgb  # outside and base
    bore: Rgb


@dataclass(frozen=True)
class DiscColors:
    """Colour of each kind of face."""

    upper: Rgb
    lower: Rgb
    rim: Rgb


def ring_boxes(hole_radius: float, outer_radius: float, height: float) -> tuple[Box, ...]:
    """Boxes whose inner faces touch the circle of `hole_radius` [m]; the origin is at the base.

    Neighbours overlap inside the ring and end flush on its outside.
    """
    half_turn = math.pi / SIDES
    half_extents = (0.5 * (outer_radius - hole_radius), outer_radius * math.tan(half_turn), 0.5 * height)
    middle = 0.5 * (outer_radius + hole_radius)
    boxes = []
    for i in range(SIDES):
        angle = 2 * half_turn * i
        centre = np.array([middle * math.cos(angle), middle * math.sin(angle), 0.5 * height])
        boxes.append(Box(half_extents, Pose.from_rpy(centre, (0.0, 0.0, angle))))
    return tuple(boxes)


def ring_mesh(hole_radius: float, outer_radius: float, height: float, paint: RingColors) -> SurfaceMesh:
    """The surface of the same ring: top, outside, bore and base, each in its colour."""
    half_turn = math.pi / SIDES
    corner = 1.0 / math.cos(half_turn)  # from the middle of a face to its corner
    angles = half_turn + 2 * half_turn * np.arange(SIDES)
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)], axis=1)
    up = np.array([0.0, 0.0, height])
    inner, outer = hole_radius * corner * directions, outer_radius * corner * directions
    vertices = np.concatenate([inner, outer, inner + up, outer + up])  # (4 SIDES, 3)
    faces: list[tuple[int, int, int]] = []
    colors: list[Rgb] = []
    for i in range(SIDES):
        j = (i + 1) % SIDES
        base_in, base_out, top_in, top_out = ((k * SIDES + i, k * SIDES + j) for k in range(4))
        for (a, b, c, d), color in (
            ((top_in[0], top_out[0], top_out[1], top_in[1]), paint.top),
            ((base_in[0], base_in[1], base_out[1], base_out[0]), paint.side),
            ((base_out[0], base_out[1], top_out[1], top_out[0]), paint.side),
            ((base_in[0], top_in[0], top_in[1], base_in[1]), paint.bore),
        ):
            faces += [(a, b, c), (a, c, d)]
            colors += [color, color]
    return SurfaceMesh(vertices, np.array(faces, dtype=np.int32), np.array(colors, dtype=np.float64))


def disc_mesh(radius: float, thickness: float, rounding: float, paint: DiscColors) -> SurfaceMesh:
    """A disc about z with its centre at the origin, edges bevelled.

    The bevel is a chord of the rounded edge.
    """
    angle = 2 * math.pi * np.arange(DISC_SIDES) / DISC_SIDES
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    half = 0.5 * thickness
    profile = (
        (radius - rounding, -half),
        (radius, -half + rounding),
        (radius, half - rounding),
        (radius - rounding, half),
    )
    rings = [np.column_stack([r * circle, np.full(DISC_SIDES, z)]) for r, z in profile]
    vertices = np.vstack([*rings, [[0.0, 0.0, -half], [0.0, 0.0, half]]])
    last = len(profile) * DISC_SIDES
    faces: list[tuple[int, int, int]] = []
    colors: list[Rgb] = []
    for i in range(DISC_SIDES):
        j = (i + 1) % DISC_SIDES
        faces += [(last, j, i), (last + 1, last - DISC_SIDES + i, last - DISC_SIDES + j)]
        colors += [paint.lower, paint.upper]
        for low in range(0, last - DISC_SIDES, DISC_SIDES):
            high = low + DISC_SIDES
            faces += [(low + i, low + j, high + j), (low + i, high + j, high + i)]
            colors += [paint.rim, paint.rim]
    return SurfaceMesh(vertices, np.array(faces, dtype=np.int32), np.array(colors, dtype=np.float64))


def box_mesh(size: tuple[float, float, float], color: Rgb) -> SurfaceMesh:
    """A box about the origin, edges `size` [m]."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], dtype=np.int32)
    return SurfaceMesh(0.5 * signs * size, faces, np.tile(color, (len(faces), 1)))
