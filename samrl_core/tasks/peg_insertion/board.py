"""The block with a hole: a ring of boxes for physics, a mesh with flat faces for cameras."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.types.pose import Pose
from samrl_core.types.scene import Body, Box, Rgb, SurfaceMesh

SIDES = 16  # boxes of the ring; boxes, because convex meshes carry a 1 mm margin that eats the clearance

TOP_COLOR: Rgb = (0.85, 0.35, 0.15)
SIDE_COLOR: Rgb = (0.45, 0.20, 0.12)
BORE_COLOR: Rgb = (0.10, 0.08, 0.25)


def ring_boxes(hole_radius: float, outer_radius: float, height: float) -> tuple[Box, ...]:
    """Boxes whose inner faces touch the circle of `hole_radius` [m]; the body's origin is at the base.

    Neighbours overlap inside the block and end flush on its outside.
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


def board_mesh(hole_radius: float, outer_radius: float, height: float) -> SurfaceMesh:
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
            ((top_in[0], top_out[0], top_out[1], top_in[1]), TOP_COLOR),
            ((base_in[0], base_in[1], base_out[1], base_out[0]), SIDE_COLOR),
            ((base_out[0], base_out[1], top_out[1], top_out[0]), SIDE_COLOR),
            ((base_in[0], top_in[0], top_in[1], base_in[1]), BORE_COLOR),
        ):
            faces += [(a, b, c), (a, c, d)]
            colors += [color, color]
    return SurfaceMesh(vertices, np.array(faces, dtype=np.int32), np.array(colors, dtype=np.float64))


def board_body(
    name: str,
    hole_radius: float,
    outer_radius: float,
    height: float,
    body_in_world: Pose,
    label: int,
    friction: float,
) -> Body:
    """The block as a fixed body. All lengths [m]."""
    return Body(
        name,
        ring_boxes(hole_radius, outer_radius, height),
        board_mesh(hole_radius, outer_radius, height),
        body_in_world,
        label,
        mass=0.0,
        friction=friction,
    )
