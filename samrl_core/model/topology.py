"""Connectivity of a scene's triangles: what the renderer must know before the first image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.errors import InputError

_WELD = 1e-6  # [m] vertices of one part nearer than this are one point


@dataclass(frozen=True, eq=False)
class Topology:
    """Triangles, their edges and labels. Build it with `Topology.build`.

    An edge row holds, for its first face, the vertex at either end, the vertex opposite and the face,
    and the same for its second face (-1 where the surface ends).
    """

    n_vertices: int
    faces: np.ndarray  # (F, 3) int32
    face_label: np.ndarray  # (F,) int32
    edges: np.ndarray  # (E, 8) int32

    @staticmethod
    def build(vertices: np.ndarray, faces: np.ndarray, label: np.ndarray, part: np.ndarray) -> Topology:
        """Finds the edges from positions, so that vertices doubled for flat colours make no silhouette.

        Args:
            vertices: (V, 3) [m], any rigid placement of each part.
            faces: (F, 3) integers.
            label: (V,) segmentation label per vertex; a face takes that of its first vertex.
            part: (V,) number of the closed surface that a vertex belongs to; only vertices of one part
                are welded, so that parts which merely touch stay apart.

        Raises:
            InputError: wrong shapes, an empty mesh, a non-finite vertex or an index out of range.
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
        if faces.min() < 0 or faces.max() >= n:
            raise InputError(f"face index {faces.min()}..{faces.max()} leaves 0..{n - 1}")
        if np.shape(label) != (n,) or np.shape(part) != (n,):
            raise InputError(f"label {np.shape(label)} and part {np.shape(part)} must be ({n},)")
        faces = faces.astype(np.int32)
        face_label = np.asarray(label)[faces[:, 0]].astype(np.int32)
        return Topology(n, faces, face_label, _edges(_weld(vertices, np.asarray(part)), faces))


def _weld(vertices: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Number of the distinct point behind each vertex (V,)."""
    rows = np.column_stack([np.round(vertices / _WELD), part])
    return np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)


def _edges(point: np.ndarray, faces: np.ndarray) -> np.ndarray:
    found: dict[tuple[int, int], list[tuple[int, int, int, int]]] = {}
    for f, face in enumerate(faces.tolist()):
        for k in range(3):
            i, j, opposite = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            p, q = int(point[i]), int(point[j])
            if p == q:
                continue  # a side of no length
            if p > q:
                p, q, i, j = q, p, j, i
            found.setdefault((p, q), []).append((i, j, opposite, f))
    rows = []
    for uses in found.values():
        # More than two faces at an edge (surfaces folded onto each other) are taken two by two.
        for k in range(0, len(uses), 2):
            rows.append((*uses[k], *(uses[k + 1] if k + 1 < len(uses) else (-1, -1, -1, -1))))
    return np.array(rows, dtype=np.int32)
