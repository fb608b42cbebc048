"""An arm's own meshes in place of its simple shapes, for cameras alone; physics keeps the shapes.

The files are those of PyBullet's wheel: Franka's (Apache-2.0), 12,000 to 22,000 faces a link. At 128 pixels a
face of a few millimetres is enough, and TinyRenderer's time goes with the faces. So vertices are joined on a
grid, and the mean of their normals shades the rest round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Rgb

FINEST = 0.004  # cells within which vertices are joined, at first [m]
PREFIX = "package://"


@dataclass(frozen=True, eq=False)
class MeshVisual:
    """A mesh on a link, to look at."""

    file: Path  # OBJ
    mesh_in_link: Pose
    color: Rgb


def mesh_visual(uri: str, mesh_in_link: Pose, color: Rgb, folder: Path, most_faces: int) -> MeshVisual | None:
    """The coarse mesh of a `package://` address, written into `folder`; None where it is not installed."""
    found = _installed(uri)
    if found is None:
        return None
    vertices, normals, faces = coarse_mesh(found, most_faces)
    file = folder / f"{found.parent.name}_{found.stem}_coarse.obj"
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    lines += [f"vn {x:.5f} {y:.5f} {z:.5f}" for x, y, z in normals]
    lines += ["f " + " ".join(f"{i}//{i}" for i in face) for face in (faces + 1).tolist()]
    file.write_text("\n".join(lines) + "\n", encoding="ascii")
    return MeshVisual(file, mesh_in_link, color)


@cache
def coarse_mesh(file: Path, most_faces: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (V, 3) [m], normals (V, 3) and faces (F, 3) of a mesh with its vertices joined on a grid.

    The grid is widened until there are `most_faces` at most.
    """
    mesh = trimesh.load_mesh(file, process=False, skip_materials=True)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    grid = 1e-6
    cell = _cells(vertices, grid)
    while len(_faces_between(cell[faces])) > most_faces:
        grid = max(FINEST, 1.2 * grid)
        cell = _cells(vertices, grid)
    count = np.bincount(cell)[:, None]
    joined = np.stack([np.bincount(cell, vertices[:, k]) for k in range(3)], axis=1) / count
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # weighted by area
    normals = np.stack(
        [np.bincount(cell[faces].ravel(), np.repeat(normal[:, k], 3), len(joined)) for k in range(3)], axis=1
    )
    lengths = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return joined, normals / lengths, _faces_between(cell[faces])


def _faces_between(corners: np.ndarray) -> np.ndarray:
    """Faces (F, 3) whose corners are three different cells, each once."""
    a, b, c = corners.T
    kept = corners[(a != b) & (b != c) & (a != c)]
    _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    return kept[np.sort(first)]


def _cells(vertices: np.ndarray, grid: float) -> np.ndarray:
    """Number of the cell that each vertex is in, (V,)."""
    _, cell = np.unique(np.round(vertices / grid).astype(np.int64), axis=0, return_inverse=True)
    return cell.ravel()


def _installed(uri: str) -> Path | None:
    import pybullet_data

    if not uri.startswith(PREFIX):
        return None
    file = Path(pybullet_data.getDataPath()) / uri.removeprefix(PREFIX)
    return file if file.is_file() else None
