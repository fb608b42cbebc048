"""The block with a hole."""

from __future__ import annotations

from samrl_core.cell.tasks.shapes import RingColors, ring_boxes, ring_mesh
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Rgb

TOP_COLOR: Rgb = (0.85, 0.35, 0.15)
SIDE_COLOR: Rgb = (0.45, 0.20, 0.12)
BORE_COLOR: Rgb = (0.10, 0.08, 0.25)
PAINT = RingColors(TOP_COLOR, SIDE_COLOR, BORE_COLOR)


def board_body(
    name: str,
    hole_radius: float,
    outer_radius: float,
    height: float,
    body_in_world: Pose,
    label: int,
    friction: float,
) -> Body:
    """The block as a fixed body, its origin at the base. All lengths [m]."""
    return Body(
        name,
        ring_boxes(hole_radius, outer_radius, height),
        ring_mesh(hole_radius, outer_radius, height, PAINT),
        body_in_world,
        label,
        mass=0.0,
        friction=friction,
    )
