"""Triangles of boxes, cylinders, frustums and capsules, and meshes whose faces are flat in colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.scene import Box, Capsule, Cylinder, Part, Rgb, SurfaceMesh
from samrl_core.common.errors import InputError

SEGMENTS = 14  # of a cylinder; a 60 mm link then departs from round by 0.8 mm


def box_mesh(half_extents: tuple[float, float, float], color: Rgb) -> SurfaceMesh:
    """A box about the origin.

    Raises:
        InputError: a half extent is not positive.
    """
    h = np.asarray(half_extents, dtype=np.float64)
    if h.shape != (3,) or not (h > 0).all():
        raise InputError(f"box half extents {half_extents} m must be three positive numbers")
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * h
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return SurfaceMesh(corners, np.array(faces, dtype=np.int32), np.tile(color, (12, 1)))


def frustum_mesh(
    bottom_radius: float, top_radius: float, length: float, color: Rgb, segments: int = SEGMENTS
) -> SurfaceMesh:
    """A truncated cone about z, from -length/2 to +length/2 [m].

    Raises:
        InputError: a size is not positive, or fewer than three segments.
    """
    if not (bottom_radius > 0 and top_radius > 0 and length > 0) or segments < 3:
        raise InputError(
            f"frustum of radii {bottom_radius}, {top_radius} m, length {length} m, {segments} segments: "
            "sizes must be positive, segments at least 3"
        )
    angle = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([bottom_radius * ring, np.full(segments, -0.5 * length)])
    high = np.column_stack([top_radius * ring, np.full(segments, 0.5 * length)])
    vertices = np.vstack([low, high, [[0, 0, -0.5 * length], [0, 0, 0.5 * length]]])
    n, faces = segments, []
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i), (2 * n, j, i), (2 * n + 1, n + i, n + j)]
    return SurfaceMesh(vertices, np.array(faces, dtype=np.int32), np.tile(color, (len(faces), 1)))


def revolved_mesh(
    radius: np.ndarray, height: np.ndarray, color: Rgb, segments: int = SEGMENTS
) -> SurfaceMesh:
    """A closed surface about z: rings of `radius` (R,) at `height` (R,) [m], pointed at both ends.

    The first and the last radius are 0, all others positive. The rings' corners lie as far outside of the
    circle as their sides lie inside, so that the outline is on average as wide as the circle's.

    Raises:
        InputError: fewer than three rings or segments, radii as above, or heights that go down.
    """
    r, z = np.asarray(radius, dtype=np.float64), np.asarray(height, dtype=np.float64)
    closed = r.ndim == 1 and r.shape == z.shape and r.size >= 3 and r[0] == 0 and r[-1] == 0
    if not closed or not (r[1:-1] > 0).all() or not (np.diff(z) >= 0).all() or segments < 3:
        raise InputError(
            f"surface about z of radii {r} m at heights {z} m, {segments} segments: radii must be 0 at both "
            "ends and positive between, heights must not go down, segments be at least 3"
        )
    n, rings = segments, r.size - 2
    # Mean over all directions of a polygon's half width, for corners at distance 1.
    mean_half_width = np.sin(np.pi / n) / (np.pi / n)
    angle = 2 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) / mean_half_width
    vertices = np.vstack(
        [np.column_stack([a * circle, np.full(n, b)]) for a, b in zip(r[1:-1], z[1:-1], strict=True)]
        + [[[0.0, 0.0, z[0]], [0.0, 0.0, z[-1]]]]
    )
    low, high = rings * n, rings * n + 1
    faces: list[tuple[int, int, int]] = []
    for i in range(n):
        j = (i + 1) % n
        faces += [(low, j, i), (high, low - n + i, low - n + j)]
        for a in range(0, low - n, n):
            faces += [(a + i, a + j, a + n + j), (a + i, a + n + j, a + n + i)]
    return SurfaceMesh(vertices, np.array(faces, dtype=np.int32), np.tile(color, (len(faces), 1)))


def capsule_mesh(radius: float, length: float, color: Rgb, segments: int = SEGMENTS) -> SurfaceMesh:
    """A cylinder about z with half balls at its ends, whose centres are `length` apart [m].

    Raises:
        InputError: a size is not positive, or fewer than three segments.
    """
    if not (radius > 0 and length > 0):
        raise InputError(f"capsule of radius {radius} m and length {length} m: both must be positive")
    r, z = ball_rings(radius)
    rings = (np.concatenate([r, r[::-1]]), np.concatenate([-z - 0.5 * length, z[::-1] + 0.5 * length]))
    return revolved_mesh(*rings, color, segments)


def ball_rings(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Radii (3,) and heights (3,) over its flat face of a half ball's rings, from the pole down [m]."""
    angle = np.array([0.0, 0.25, 0.5]) * np.pi
    ring = radius * np.sin(angle)
    ring[0] = 0.0
    return ring, radius * np.cos(angle) * [1.0, 1.0, 0.0]


def part_mesh(part: Part, color: Rgb, segments: int = SEGMENTS) -> SurfaceMesh:
    """A box, cylinder or capsule, at its pose in its body.

    Raises:
        InputError: a size is not positive, or a part of another kind.
    """
    if isinstance(part, Box):
        mesh = box_mesh(part.half_extents, color)
    elif isinstance(part, Cylinder):
        mesh = frustum_mesh(part.radius, part.radius, part.length, color, segments)
    elif isinstance(part, Capsule):
        mesh = capsule_mesh(part.radius, part.length, color, segments)
    else:
        raise InputError(f"no mesh is known for a part of type {type(part).__name__}")
    return SurfaceMesh(part.part_in_body.apply(mesh.vertices), mesh.faces, mesh.face_color)


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Outward unit normals (F, 3); zero for a face of no area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    length = np.linalg.norm(n, axis=1, keepdims=True)
    return n / np.where(length > 0, length, 1.0)


@dataclass(frozen=True, eq=False)
class FlatMesh:
    """A mesh whose vertices are doubled wherever faces of different groups meet."""

    vertices: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3) int32
    group: np.ndarray  # (V,) int64 group of the faces at a vertex


def flatten(mesh: SurfaceMesh, face_group: np.ndarray) -> FlatMesh:
    """Doubles vertices so that each belongs to one group of faces; face_group is (F,) integers."""
    pairs = np.column_stack([mesh.faces.reshape(-1), np.repeat(face_group, 3)])
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 3).astype(np.int32)
    return FlatMesh(mesh.vertices[unique[:, 0]], faces, unique[:, 1].astype(np.int64))
