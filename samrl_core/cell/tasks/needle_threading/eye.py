"""The needle: its eye is a ring with a vertical axis, held by a thin post."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.tasks.shapes import RingColors, box_mesh, ring_boxes, ring_mesh
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Box, Rgb, SurfaceMesh

STEEL: Rgb = (0.70, 0.70, 0.78)
PAINT = RingColors(top=(0.20, 0.45, 0.85), side=(0.15, 0.30, 0.60), bore=(0.85, 0.80, 0.30))


def needle_body(
    name: str,
    eye_radius: float,
    outer_radius: float,
    thickness: float,
    post_width: float,
    eye_in_world: Pose,
    label: int,
    friction: float,
) -> Body:
    """A fixed body with its origin at the eye's centre. Lengths [m].

    The post stands beside the ring (at its +y side), from the table up to the ring's upper face.
    """

    def shift(z: float) -> Pose:
        return Pose(np.array([0.0, 0.0, z]), np.array([0.0, 0.0, 0.0, 1.0]))

    boxes = tuple(
        Box(box.half_extents, shift(-0.5 * thickness) @ box.part_in_body)
        for box in ring_boxes(eye_radius, outer_radius, thickness)
    )
    height = float(eye_in_world.position[2]) + 0.5 * thickness
    centre = np.array([0.0, outer_radius + 0.5 * post_width, 0.5 * (thickness - height)])
    size = (post_width, post_width, height)
    post = Box(
        (0.5 * post_width, 0.5 * post_width, 0.5 * height), Pose(centre, np.array([0.0, 0.0, 0.0, 1.0]))
    )
    ring = ring_mesh(eye_radius, outer_radius, thickness, PAINT)
    bar = box_mesh(size, STEEL)
    mesh = SurfaceMesh(
        np.concatenate([ring.vertices - [0.0, 0.0, 0.5 * thickness], bar.vertices + centre]),
        np.concatenate([ring.faces, bar.faces + len(ring.vertices)]).astype(np.int32),
        np.concatenate([ring.face_color, bar.face_color]),
    )
    return Body(name, (*boxes, post), mesh, eye_in_world, label, 0.0, friction)
