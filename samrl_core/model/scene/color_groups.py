"""Which faces of a body share one colour parameter, and the colour it starts with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.scene import Body
from samrl_core.model.scene.meshes import face_normals

_FACING = 0.8  # cosine to the body's z axis above which a face counts as top or bottom


@dataclass(frozen=True, eq=False)
class ColorGroups:
    """Groups of the faces of one body; a group has one CAD colour and one rough direction."""

    names: tuple[str, ...]  # "<body>/<direction>", G of them
    face_group: np.ndarray  # (F,) int64 into names
    initial: np.ndarray  # (G, 3) linear RGB


def lambert(normals: np.ndarray, ambient: float, towards_light: np.ndarray) -> np.ndarray:
    """Brightness (N,) of unit normals (N, 3) under ambient and one directional light (Lambert 1760)."""
    light = np.asarray(towards_light, dtype=np.float64)
    light = light / np.linalg.norm(light)
    return ambient + (1.0 - ambient) * np.clip(normals @ light, 0.0, None)


def color_groups(body: Body, ambient: float, towards_light: np.ndarray) -> ColorGroups:
    """Top, bottom, four quadrants of the outside, and the bore, each split by CAD colour.

    A side face looks outwards when its normal points away from the body's z axis, else it is a bore;
    a bore is one group: only its far wall is visible, and small. A group starts with its CAD colour times
    the mean brightness of its faces (by area).
    """
    mesh = body.mesh
    vertices = body.body_in_world.rotation @ mesh.vertices.T
    normals = face_normals(mesh.vertices, mesh.faces)
    corners = mesh.vertices[mesh.faces]  # (F, 3 corners, 3)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    brightness = lambert(face_normals(vertices.T, mesh.faces), ambient, towards_light)
    middle = corners.mean(axis=1)
    outward = np.einsum("ij,ij->i", middle[:, :2], normals[:, :2]) > 0
    quadrant = np.floor(np.arctan2(normals[:, 1], normals[:, 0]) / (np.pi / 2) + 0.5).astype(int) % 4
    where = np.where(outward, np.char.add("side_", quadrant.astype(str)), "bore")
    where = np.where(normals[:, 2] > _FACING, "top", where)
    where = np.where(normals[:, 2] < -_FACING, "bottom", where)
    colors, color_index = np.unique(mesh.face_color, axis=0, return_inverse=True)
    color_index = color_index.reshape(-1)
    names: list[str] = []
    initial: list[np.ndarray] = []
    face_group = np.zeros(len(mesh.faces), dtype=np.int64)
    for direction in sorted(set(where.tolist())):
        shades = sorted(set(color_index[where == direction].tolist()))
        for i, shade in enumerate(shades):
            chosen = (where == direction) & (color_index == shade)
            face_group[chosen] = len(names)
            names.append(f"{body.name}/{direction}" + (f"_{i}" if len(shades) > 1 else ""))
            initial.append(colors[shade] * np.average(brightness[chosen], weights=area[chosen] + 1e-12))
    return ColorGroups(tuple(names), face_group, np.clip(np.array(initial), 0.0, 1.0))
