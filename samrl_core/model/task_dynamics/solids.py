"""A body's parts as the physics' solids, and the points by which bodies touch the solids of others."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Box, Capsule, Cylinder, Part
from samrl_core.common.errors import InputError
from samrl_core.model.physics.shapes import Shape, box, capsule, cylinder, ring

UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


def solids_of(body: Body, edge: float) -> tuple[Shape, ...]:
    """The solids of a body, in its frame; boxes that stand in a ring become one round washer.

    Args:
        body: its parts are boxes, cylinders or capsules.
        edge: rounding of edges where the body states none [m].
    """
    boxes = _radial_boxes(body)
    shapes = [solid_of(part, body.rounding or edge) for part in body.parts if part not in boxes]
    sizes = ring_of(body)
    if sizes is None:
        return tuple(shapes)
    inner, outer, top = sizes
    height = 2 * boxes[0].half_extents[2]
    where = Pose(np.array([0.0, 0.0, top - 0.5 * height]), UNTURNED)
    return (ring(inner, outer, height, 0.0, edge, where), *shapes)


def ring_of(body: Body) -> tuple[float, float, float] | None:
    """Inner and outer radius and height of the top of the ring that a body's boxes make [m]; None without.

    Raises:
        InputError: the ring is uneven.
    """
    boxes = _radial_boxes(body)
    if not boxes:
        return None
    centers = np.array([b.part_in_body.position for b in boxes])
    halves = np.array([b.half_extents for b in boxes])
    distance = np.hypot(centers[:, 0], centers[:, 1])
    numbers = np.column_stack([distance - halves[:, 0], distance + halves[:, 0], centers[:, 2], halves[:, 2]])
    if np.ptp(numbers, axis=0).max() > 1e-6:
        raise InputError(f"body {body.name} is no even ring: radii, heights and sizes of its boxes differ")
    inner, outer, middle, half_height = numbers[0].tolist()
    return inner, outer, middle + half_height


def solid_of(part: Part, edge: float) -> Shape:
    """One part as a solid whose edges are rounded by `edge` [m]."""
    if isinstance(part, Box):
        return box(part.half_extents, edge, part.part_in_body)
    if isinstance(part, Cylinder):
        return cylinder(part.radius, part.length, edge, part.part_in_body)
    return capsule(part.radius, part.length, part.part_in_body)


def capsule_balls(part: Capsule, count: int) -> np.ndarray:
    """Centres (count, 3) of balls of the capsule's radius along it [m]; the last is its far end."""
    along = part.length * (np.arange(1, count + 1) / count - 0.5)
    return part.part_in_body.apply(np.column_stack([np.zeros((count, 2)), along]))


def rim_balls(part: Cylinder, rounding: float, count: int, both: bool = True) -> np.ndarray:
    """Centres (2 count, 3) of balls of radius `rounding` on a cylinder's rims [m], or (count, 3) on one."""
    angle = 2 * math.pi * np.arange(count) / count
    circle = (part.radius - rounding) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    height = 0.5 * part.length - rounding
    ends = (height, -height) if both else (height,)
    return part.part_in_body.apply(np.vstack([np.column_stack([circle, np.full(count, z)]) for z in ends]))


def edge_balls(part: Box, edge: float, axis: int, ends: Sequence[tuple[int, int]], count: int) -> np.ndarray:
    """Centres (E * count, 3) of balls of radius `edge` along E edges of a box [m].

    Args:
        part: the box.
        edge: its edges' rounding [m].
        axis: along which the edges run.
        ends: signs of the other two axes, in their order, per edge.
        count: balls per edge.
    """
    half = np.array(part.half_extents) - edge
    across = [i for i in range(3) if i != axis]
    points = np.zeros((len(ends), count, 3))
    points[:, :, axis] = np.linspace(-half[axis], half[axis], count)
    for k, signs in enumerate(ends):
        for i, sign in zip(across, signs, strict=True):
            points[k, :, i] = sign * half[i]
    return part.part_in_body.apply(points.reshape(-1, 3))


def part_at(parts: Sequence[Part], point: np.ndarray) -> Part | None:
    """The part that ends at a point (3,) of its body: a cylinder's far end, or the middle of a box's edge."""
    for part in parts:
        local = part.part_in_body.inverse().apply(point)
        if isinstance(part, Box):
            half = np.array(part.half_extents)
            if abs(abs(local[0]) - half[0]) < 1e-6 and abs(local[1]) < 1e-6 and abs(local[2]) <= half[2]:
                return part
        elif abs(local[2] - 0.5 * part.length) < 1e-6 and float(np.hypot(local[0], local[1])) < 1e-6:
            return part
    return None


def _radial_boxes(body: Body) -> list[Box]:
    """Boxes whose x axes point away from the body's z axis, if there are enough for a ring."""
    found = []
    for part in body.parts:
        point, axis = part.part_in_body.position, part.part_in_body.rotation[:, 0]
        distance = float(np.hypot(point[0], point[1]))
        if isinstance(part, Box) and distance > 1e-9 and axis[:2] @ point[:2] > distance * (1.0 - 1e-6):
            found.append(part)
    return found if len(found) > 2 else []
