"""Mesh files and URDF links: surface, unit and colours survive; what is wrong is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.visual import ColorVisuals

from samrl_core.cell.types.scene import SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.scene.mesh_checks import mesh_faults
from samrl_core.model.scene.mesh_file import load_mesh

SIDES = (0.04, 0.06, 0.10)  # [m]
RED, BLUE = [204, 0, 0, 255], [0, 0, 204, 255]


def volume(mesh: SurfaceMesh) -> float:
    return mesh_faults(mesh.vertices, mesh.faces).volume


def exported(folder: Path, name: str, scale: float = 1.0) -> Path:
    box = trimesh.creation.box(extents=np.array(SIDES) * scale)
    box.visual = ColorVisuals(box, face_colors=[RED] * 6 + [BLUE] * 6)
    box.export(folder / name)
    return folder / name


@pytest.mark.parametrize("name", ["box.stl", "box.obj", "box.ply", "box.off", "box.glb"])
def test_every_format_gives_the_box_in_metres(tmp_path: Path, name: str) -> None:
    mesh = load_mesh(exported(tmp_path, name, 1000.0), metres_per_unit=1e-3)
    assert np.allclose(np.ptp(mesh.vertices, axis=0), SIDES)
    assert volume(mesh) == pytest.approx(np.prod(SIDES), rel=1e-5)


def test_colors_come_from_the_file_or_from_the_caller(tmp_path: Path) -> None:
    painted = load_mesh(exported(tmp_path, "box.ply"), 1.0)
    assert np.allclose(painted.face_color[:6], [0.8, 0, 0]) and np.allclose(
        painted.face_color[6:], [0, 0, 0.8]
    )
    bare = load_mesh(exported(tmp_path, "box.stl"), 1.0, color=(0.1, 0.2, 0.3))
    assert np.allclose(bare.face_color, [0.1, 0.2, 0.3])


def test_millimetres_read_as_metres_are_suspected(tmp_path: Path) -> None:
    path = exported(tmp_path, "box.stl", 1000.0)
    with pytest.raises(InputError, match=r"box\.stl: its longest side is 100 m.*millimetres are suspected"):
        load_mesh(path, metres_per_unit=1.0)
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="metres_per_unit"):
            load_mesh(path, bad)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.stl", b"", "0 bytes"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "no triangles"),
        ("torn.ply", b"ply\n", "cannot be read"),
        ("drawing.step", b"ISO-10303-21;", r"no mesh that can be read.*'stl'"),
        ("nan.obj", b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "1 of 3 vertices are not finite"),
        (
            "far.obj",
            b"v 0 0 0\nv 1 0 1e300\nv 0 1 0\nf 1 2 3\n",
            r"vertex 1 lies 1e\+300 m from the origin",
        ),
        ("sheet.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "3 open edges"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        load_mesh(tmp_path / name, 1.0)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no mesh at .*none\.stl"):
        load_mesh(tmp_path / "none.stl", 1.0)
