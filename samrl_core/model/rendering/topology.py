"""Connectivity of a scene's triangles: what the renderer must know before the first image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from samrl_core.common.errors import InputError

_WELD = 1e-6  # [m] vertices of one part nearer than this are one point
_THIN = 1e-7  # height of a triangle over its longest side below which it is a line: single precision


@dataclass(frozen=True, eq=False)
class Topology:
    """Triangles, their edges, labels and shared normals. Build it with `Topology.build`.

    An edge is a range of `edge_uses`, one row per face at it: the vertex at either end, in one order for
    all its faces, the vertex opposite, the face. One row is a border of the surface, more than two a
    surface that branches. Faces of no area, and those that repeat an earlier one (the same corners in any
    order, as exporters of two-sided surfaces write them), are left out.
    """

    n_vertices: int
    faces: np.ndarray  # (F, 3) int32
    face_label: np.ndarray  # (F,) int32
    face_part: np.ndarray  # (F,) int32
    edge_start: np.ndarray  # (E + 1,) int32 into edge_uses
    edge_uses: np.ndarray  # (U, 4) int32
    neighbors: np.ndarray  # (F, 3) int32 face across the side opposite each corner; -1: none, or branching
    corner_normal: np.ndarray  # (F, 3) int32 which normal a corner has; corners that share one are smooth
    normal_start: np.ndarray  # (N + 1,) int32 into normal_faces
    normal_faces: np.ndarray  # (3F,) int32 faces whose areas a normal averages, once per corner
    dropped: np.ndarray  # (D,) int32 which of the faces handed in are left out

    @staticmethod
    def build(
        vertices: np.ndarray,
        faces: np.ndarray,
        label: np.ndarray,
        part: np.ndarray,
        smooth_angle: float | np.ndarray = 0.0,
    ) -> Topology:
        """Finds the edges from positions, so that vertices doubled by loaders or colours make no silhouette.

        Args:
            vertices: (V, 3) [m], any rigid placement of each part.
            faces: (F, 3) integers.
            label: (V,) segmentation label per vertex; a face takes that of its first vertex.
            part: (V,) number of the closed surface that a vertex belongs to; only vertices of one part
                are welded, so that parts which merely touch stay apart.
            smooth_angle: neighbours whose normals differ by less share a normal in lit images [rad]; one
                number or (V,), a face takes that of its first vertex. 0 gives flat faces.

        Raises:
            InputError: wrong shapes, an empty mesh, a non-finite vertex, an index out of range, or no
                face that has an area.
        """
        vertices = np.asarray(vertices, dtype=np.float64)
        faces = np.asarray(faces)
        n = len(vertices)
        if vertices.ndim != 2 or vertices.shape[1:] != (3,) or faces.ndim != 2 or faces.shape[1:] != (3,):
            raise InputError(
                f"mesh needs vertices (V, 3) and faces (F, 3), got {vertices.shape}, {faces.shape}"
            )
        if n == 0 or len(faces) == 0:
            raise InputError(f"mesh has {n} vertices and {len(faces)} faces; nothing could be rendered")
        if not np.isfinite(vertices).all():
            bad = int(np.argmin(np.isfinite(vertices).all(axis=1)))
            raise InputError(f"mesh vertex {bad} is {vertices[bad]}, must be finite")
        if not np.issubdtype(faces.dtype, np.integer):
            raise InputError(f"faces are {faces.dtype}, must be integers")
        if faces.min() < 0 or faces.max() >= n:
            raise InputError(f"face index {faces.min()}..{faces.max()} leaves 0..{n - 1}")
        if np.shape(label) != (n,) or np.shape(part) != (n,):
            raise InputError(f"label {np.shape(label)} and part {np.shape(part)} must be ({n},)")
        angle = np.broadcast_to(np.asarray(smooth_angle, dtype=np.float64), (n,))
        if not ((angle >= 0) & (angle <= np.pi)).all():
            raise InputError(f"smooth_angle {smooth_angle} must lie within 0..pi rad")
        faces = faces.astype(np.int32)
        point = _weld(vertices, np.asarray(part))
        flat = _without_area(vertices, point, faces)
        if flat.all():
            raise InputError(f"none of {len(faces)} faces has an area; the mesh is invisible")
        real = ~(flat | _repeated(point, faces))
        faces = faces[real]
        start, uses = _edges(point, faces)
        normal = _shared_normals(vertices, faces, start, uses, angle[faces[:, 0]])
        order = np.argsort(normal.reshape(-1), kind="stable")
        return Topology(
            n,
            faces,
            np.asarray(label)[faces[:, 0]].astype(np.int32),
            np.unique(part, return_inverse=True)[1].reshape(-1)[faces[:, 0]].astype(np.int32),
            start,
            uses,
            _neighbors(faces, start, uses),
            normal,
            np.concatenate([[0], np.cumsum(np.bincount(normal.reshape(-1)))]).astype(np.int32),
            (order // 3).astype(np.int32),
            np.nonzero(~real)[0].astype(np.int32),
        )


def _weld(vertices: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Number of the distinct point behind each vertex (V,)."""
    n = len(vertices)
    # Equal ones first: thousands of copies of one point would make as many million pairs.
    _, first, same = np.unique(
        np.column_stack([vertices, part]), axis=0, return_index=True, return_inverse=True
    )
    pairs = KDTree(vertices[first]).query_pairs(_WELD, output_type="ndarray")
    pairs = pairs[np.asarray(part)[first[pairs[:, 0]]] == np.asarray(part)[first[pairs[:, 1]]]]
    return _groups(pairs, len(first))[same.reshape(n)]


def _groups(pairs: np.ndarray, n: int) -> np.ndarray:
    """Connected components (n,) of the graph with these edges."""
    graph = coo_array((np.ones(len(pairs), dtype=bool), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return connected_components(graph, directed=False)[1]


def _without_area(vertices: np.ndarray, point: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Faces (F,) with two corners in one point or all three on a line."""
    p, c = point[faces], vertices[faces]
    sides = np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 1], c[:, 0] - c[:, 2]], axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    twice = (p[:, 0] == p[:, 1]) | (p[:, 1] == p[:, 2]) | (p[:, 2] == p[:, 0])
    return twice | (area <= _THIN * longest**2)


def _repeated(point: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Faces (F,) with the corners of an earlier one."""
    corners = np.sort(point[faces], axis=1)
    first, same = np.unique(corners, axis=0, return_index=True, return_inverse=True)[1:]
    return first[same.reshape(-1)] != np.arange(len(faces))


def _edges(point: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts (E + 1,) and uses (U, 4) of all edges; within an edge by face number."""
    i = faces.T.reshape(-1)  # sides 01, 12, 20, one block after the other
    j = faces[:, [1, 2, 0]].T.reshape(-1)
    opposite = faces[:, [2, 0, 1]].T.reshape(-1)
    face = np.tile(np.arange(len(faces)), 3)
    turned = point[i] > point[j]
    i, j = np.where(turned, j, i), np.where(turned, i, j)
    order = np.lexsort((face, point[j], point[i]))
    uses = np.column_stack([i, j, opposite, face])[order].astype(np.int32)
    ends = point[uses[:, :2]]
    new = np.nonzero(np.any(ends[1:] != ends[:-1], axis=1))[0] + 1
    return np.concatenate([[0], new, [len(uses)]]).astype(np.int32), uses


def _manifold(start: np.ndarray, uses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both uses (M, 4) of every edge that has exactly two."""
    first = start[:-1][np.diff(start) == 2]
    return uses[first], uses[first + 1]


def _corner(faces: np.ndarray, face: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """Which corner (M,) of a face is that vertex."""
    return np.argmax(faces[face] == vertex[:, None], axis=1)


def _neighbors(faces: np.ndarray, start: np.ndarray, uses: np.ndarray) -> np.ndarray:
    result = np.full((len(faces), 3), -1, dtype=np.int32)
    a, b = _manifold(start, uses)
    result[a[:, 3], _corner(faces, a[:, 3], a[:, 2])] = b[:, 3]
    result[b[:, 3], _corner(faces, b[:, 3], b[:, 2])] = a[:, 3]
    return result


def _shared_normals(
    vertices: np.ndarray, faces: np.ndarray, start: np.ndarray, uses: np.ndarray, angle: np.ndarray
) -> np.ndarray:
    """Number of the normal of every corner (F, 3): connected through edges flatter than the angle."""
    n = len(faces)
    c = vertices[faces]
    area = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    unit = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)
    a, b = _manifold(start, uses)
    fa, fb = a[:, 3], b[:, 3]
    bend = np.arccos(np.clip(np.einsum("ij,ij->i", unit[fa], unit[fb]), -1.0, 1.0))
    smooth = bend < np.minimum(angle[fa], angle[fb])
    a, b, fa, fb = a[smooth], b[smooth], fa[smooth], fb[smooth]
    links = [
        np.column_stack([3 * fa + _corner(faces, fa, a[:, k]), 3 * fb + _corner(faces, fb, b[:, k])])
        for k in (0, 1)
    ]
    own = 3 * np.arange(n)[angle == 0.0]  # the corners of a flat face share its one normal
    links += [np.column_stack([own, own + 1]), np.column_stack([own, own + 2])]
    return _groups(np.concatenate(links), 3 * n).reshape(n, 3).astype(np.int32)
