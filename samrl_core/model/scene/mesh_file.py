"""A surface from a CAD file, in metres, checked."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from samrl_core.cell.types.scene import Rgb, SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.scene.mesh_checks import MeshLimits, require_sound

GREY: Rgb = (0.7, 0.7, 0.7)  # of a file without colours; Real2Sim corrects it


def load_mesh(
    path: Path, metres_per_unit: float, color: Rgb = GREY, limits: MeshLimits | None = None
) -> SurfaceMesh:
    """All surfaces of a file as one, each face in its colour.

    Colours are taken as linear, as the cell's camera images are; a texture gives each face the mean at its
    corners.

    Args:
        path: any format that trimesh reads without further packages: OBJ, STL, PLY, OFF, glTF.
        metres_per_unit: 1 where the file is in metres, 0.001 for millimetres. Most formats do not state it.
        color: where the file has none.
        limits: what may be wrong with it; None for a closed body of the cell's size.

    Raises:
        InputError: no such file, nothing in it, not to be read, or a surface that `require_sound` refuses.
    """
    if not (math.isfinite(metres_per_unit) and metres_per_unit > 0):
        raise InputError(f"metres_per_unit is {metres_per_unit}, must be positive: 1, or 0.001 for mm")
    mesh, part = read_parts(path, np.full(3, metres_per_unit), color)
    require_sound(mesh, str(path), limits, part)
    return mesh


def read_parts(path: Path, scale: np.ndarray, color: Rgb) -> tuple[SurfaceMesh, np.ndarray]:
    """The surface, not yet checked, and which of the file's surfaces each vertex (V,) is of.

    Raises:
        InputError: no such file, nothing in it, or not to be read.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"no mesh at {path}; give the path of an existing file")
    if path.stat().st_size == 0:
        raise InputError(f"{path} has 0 bytes; export the mesh again")
    formats = sorted(trimesh.available_formats())
    if path.suffix[1:].lower() not in formats:
        raise InputError(f"{path} is no mesh that can be read, only {formats}; convert it to one of these")
    try:
        scene = trimesh.load_scene(str(path), process=False)
        found = [g for g in scene.dump() if isinstance(g, trimesh.Trimesh) and len(g.faces)]
        pieces = [_surface(g, scale, color) for g in found]
    except Exception as error:  # its parsers raise whatever they stumble over
        raise InputError(
            f"{path} cannot be read ({type(error).__name__}: {error}); export it again"
        ) from error
    if not pieces:
        raise InputError(f"{path} has no triangles; is it empty, or a cloud of points?")
    return joined(pieces)


def joined(pieces: list[SurfaceMesh]) -> tuple[SurfaceMesh, np.ndarray]:
    """Several surfaces as one, and which of them each vertex (V,) is of."""
    starts = np.cumsum([0] + [len(p.vertices) for p in pieces])
    mesh = SurfaceMesh(
        np.concatenate([p.vertices for p in pieces]),
        np.concatenate([p.faces + n for p, n in zip(pieces, starts[:-1], strict=True)]).astype(np.int32),
        np.concatenate([p.face_color for p in pieces]),
    )
    return mesh, np.repeat(np.arange(len(pieces)), np.diff(starts))


def _surface(mesh: trimesh.Trimesh, scale: np.ndarray, color: Rgb) -> SurfaceMesh:
    visual: Any = mesh.visual
    if visual is not None and visual.defined:
        visual = visual.to_color() if visual.kind == "texture" else visual
        face_color = np.asarray(visual.face_colors, dtype=np.float64)[:, :3] / 255.0
    else:
        face_color = np.tile(np.asarray(color, dtype=np.float64), (len(mesh.faces), 1))
    faces = np.asarray(mesh.faces, dtype=np.int32)
    if np.prod(scale) < 0:
        faces = faces[:, ::-1]  # mirrored: what was wound outwards would be wound inwards
    return SurfaceMesh(np.asarray(mesh.vertices, dtype=np.float64) * scale, faces, face_color)
