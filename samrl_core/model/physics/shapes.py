"""Solids that points can touch: analytic signed distances, described in the frame of their body.

An edge would make the normal jump; so every solid with edges has a `rounding`: its edges are rounded by
that radius, its faces stay where they are. Normals are continuous as long as a point sinks in by less.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError

PROFILE_CORNERS = 6  # kernels unroll over that many corners
SHAPE_FLOATS = 4 + 2 * PROFILE_CORNERS


class ShapeKind(IntEnum):
    """What the kernels switch on."""

    PLANE = 0
    BOX = 1
    CAPSULE = 2
    REVOLVED = 3


@dataclass(frozen=True, eq=False)
class Shape:
    """One solid. Made by the functions below, which check their sizes.

    `numbers` is [rounding, hx, hy, hz] [m], then the corners (rho, z) of the profile [m],
    counter-clockwise, already moved inwards by the rounding.
    """

    kind: ShapeKind
    numbers: np.ndarray  # (SHAPE_FLOATS,) [m]
    shape_in_body: Pose = field(default_factory=Pose.identity)


def plane(shape_in_body: Pose | None = None) -> Shape:
    """Everything with z <= 0 in its own frame."""
    return _shape(ShapeKind.PLANE, shape_in_body, 0.0)


def box(
    half_extents: tuple[float, float, float], rounding: float, shape_in_body: Pose | None = None
) -> Shape:
    """A box with rounded edges; `half_extents` [m] include the rounding [m]."""
    half = _sizes("half extents", half_extents)
    _check_rounding(rounding, float(half.min()))
    return _shape(ShapeKind.BOX, shape_in_body, rounding, half - rounding)


def capsule(radius: float, length: float, shape_in_body: Pose | None = None) -> Shape:
    """A capsule along z about the origin; `length` [m] is that of its straight part."""
    _sizes("capsule radius and length", (radius, length))
    return _shape(ShapeKind.CAPSULE, shape_in_body, radius, np.array([0.0, 0.0, 0.5 * length]))


def cylinder(radius: float, length: float, rounding: float, shape_in_body: Pose | None = None) -> Shape:
    """A cylinder along z about the origin, with rounded rims."""
    _sizes("cylinder radius and length", (radius, length))
    half = 0.5 * length
    # Mirrored at the axis, so that the axis is no edge of the profile.
    profile = [(-radius, -half), (radius, -half), (radius, half), (-radius, half)]
    return _revolved(profile, rounding, shape_in_body)


def ring(
    hole_radius: float,
    outer_radius: float,
    height: float,
    chamfer: float,
    rounding: float,
    shape_in_body: Pose | None = None,
) -> Shape:
    """A washer along z about the origin, its hole chamfered at both ends by 45 degrees: a needle's eye."""
    _hole_sizes(hole_radius, outer_radius, height, chamfer)
    h = 0.5 * height
    profile = [
        (outer_radius, -h),
        (outer_radius, h),
        (hole_radius + chamfer, h),
        (hole_radius, h - chamfer),
        (hole_radius, -h + chamfer),
        (hole_radius + chamfer, -h),
    ]
    return _revolved(profile, rounding, shape_in_body)


def _revolved(profile: list[tuple[float, float]], rounding: float, shape_in_body: Pose | None) -> Shape:
    return _shape(ShapeKind.REVOLVED, shape_in_body, rounding, corners=_inset(profile, rounding))


def _shape(
    kind: ShapeKind,
    shape_in_body: Pose | None,
    rounding: float,
    half: np.ndarray | None = None,
    corners: np.ndarray | None = None,
) -> Shape:
    numbers = np.zeros(SHAPE_FLOATS)
    numbers[0] = rounding
    if half is not None:
        numbers[1:4] = half
    if corners is not None:
        # The last corner again: an edge of no length is nobody's nearest.
        padded = np.concatenate([corners, np.repeat(corners[-1:], PROFILE_CORNERS - len(corners), axis=0)])
        numbers[4:] = padded.reshape(-1)
    numbers.setflags(write=False)
    return Shape(kind, numbers, Pose.identity() if shape_in_body is None else shape_in_body)


def _inset(profile: list[tuple[float, float]], rounding: float) -> np.ndarray:
    """The convex polygon moved inwards by the rounding; corners are where moved neighbours meet."""
    points = np.array(profile)
    edges = np.roll(points, -1, axis=0) - points
    lengths = np.linalg.norm(edges, axis=1)
    keep = lengths > 1e-12  # no chamfer: two corners in one
    points, edges, lengths = points[keep], edges[keep], lengths[keep]
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths[:, None]
    offsets = (normals * points).sum(axis=1) - rounding
    corners = np.array(
        [
            np.linalg.solve(np.stack([normals[i - 1], normals[i]]), [offsets[i - 1], offsets[i]])
            for i in range(len(points))
        ]
    )
    moved = np.roll(corners, -1, axis=0) - corners
    if rounding < 0 or ((moved * edges).sum(axis=1) <= 0).any():
        raise InputError(f"rounding {rounding} m leaves nothing of an edge; choose a smaller one")
    return corners


def _sizes(name: str, values: tuple[float, ...]) -> np.ndarray:
    array = np.array(values, dtype=np.float64)
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise InputError(f"{name} {values} m must be finite and positive")
    return array


def _check_rounding(rounding: float, smallest: float) -> None:
    if not 0 <= rounding < smallest:
        raise InputError(f"rounding {rounding} m must be at least 0 and below the half extent {smallest} m")


def _hole_sizes(hole: float, outer: float, height: float, chamfer: float) -> None:
    _sizes("hole radius, outer size and height", (hole, outer, height))
    if not (0 <= chamfer < 0.5 * height and hole + chamfer < outer):
        raise InputError(
            f"chamfer {chamfer} m must be at least 0, below {0.5 * height} m, and with the hole's radius "
            f"{hole} m stay below the outer size {outer} m"
        )
