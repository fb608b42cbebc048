"""Distance between two surfaces, in either direction (chamfer distance)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import KDTree

from samrl_core.common.errors import InputError

_CANDIDATES = 24  # triangles with the nearest centres that a point is measured against


@dataclass(frozen=True)
class Chamfer:
    """Mean distances from samples of one surface to the other [m]."""

    forward: float  # from the first surface to the second
    backward: float  # from the second to the first
    largest_forward: float  # 95 % of the first's samples are nearer
    largest_backward: float

    @property
    def mean(self) -> float:
        """Mean of both directions [m]."""
        return 0.5 * (self.forward + self.backward)


class Surface:
    """Triangles that points are measured against."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, longest_edge: float = 0.004) -> None:
        """Cuts triangles until no edge is longer than `longest_edge` [m]: near centres are then near faces.

        Raises:
            InputError: no faces, or a length that is not positive.
        """
        if len(faces) == 0 or not longest_edge > 0:
            raise InputError(f"{len(faces)} faces and longest edge {longest_edge} m must both be positive")
        cut = trimesh.remesh.subdivide_to_size(vertices, faces, longest_edge, max_iter=20)
        self._triangles = np.asarray(cut[0])[np.asarray(cut[1])]
        self._centers = KDTree(self._triangles.mean(axis=1))

    def distance(self, points: np.ndarray) -> np.ndarray:
        """From points (N, 3) to the surface (N,) [m]."""
        k = min(_CANDIDATES, len(self._triangles))
        near = self._centers.query(points, k=k)[1].reshape(len(points), k)
        # In millimetres: trimesh compares products of four lengths with a fixed 1e-13.
        triangles, position = 1e3 * self._triangles[near.reshape(-1)], 1e3 * np.repeat(points, k, axis=0)
        closest = trimesh.triangles.closest_point(triangles, position)
        return 1e-3 * np.linalg.norm(closest - position, axis=1).reshape(len(points), k).min(axis=1)


def surface_samples(
    vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points (count, 3) spread evenly over the area, and the face (count,) that each lies on.

    Raises:
        InputError: a surface of no area.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    if not area.sum() > 0:
        raise InputError(f"{len(faces)} faces have no area; nothing can be sampled")
    # Strata of equal area instead of independent samples: the same evenness with far fewer points.
    position = (np.arange(count) + rng.random(count)) / count * area.sum()
    face = np.minimum(np.searchsorted(np.cumsum(area), position), len(faces) - 1)
    r, s = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - r, r * (1 - s), r * s], axis=1)  # Osada et al. 2002, eq. 1
    return np.einsum("nk,nkc->nc", weights, vertices[faces[face]]), face


def chamfer(first: tuple[np.ndarray, Surface], second: tuple[np.ndarray, Surface]) -> Chamfer:
    """Of two surfaces, each given by samples (N, 3) [m] of the part that counts, and the whole of it.

    Raises:
        InputError: no samples on either side.
    """
    if min(len(first[0]), len(second[0])) == 0:
        raise InputError(f"{len(first[0])} and {len(second[0])} samples; each surface needs some that count")
    forward, backward = second[1].distance(first[0]), first[1].distance(second[0])
    far = (float(np.quantile(forward, 0.95)), float(np.quantile(backward, 0.95)))
    return Chamfer(float(forward.mean()), float(backward.mean()), *far)
