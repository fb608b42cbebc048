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
from samrl_core.model.scene.urdf_mesh import load_urdf_link

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


def written(folder: Path, visual: str, head: str = "") -> Path:
    path = folder / "part.urdf"
    path.write_text(f'<robot name="part">{head}<link name="a">{visual}</link><link name="bare"/></robot>')
    return path


def test_a_link_of_shapes_and_a_mesh(tmp_path: Path) -> None:
    exported(tmp_path, "box.ply", 1000.0)
    visual = (
        '<visual><origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/>'
        '<geometry><mesh filename="package://parts/box.ply" scale="0.001 0.001 0.001"/></geometry></visual>'
        '<visual><geometry><box size="0.1 0.1 0.2"/></geometry><material name="green"/></visual>'
        '<visual><origin xyz="0 0.5 0"/><geometry><cylinder radius="0.05" length="0.2"/></geometry></visual>'
        '<visual><origin xyz="0 0 0.5"/><geometry><sphere radius="0.05"/></geometry>'
        '<material name="own"><color rgba="0.1 0.2 0.3 1"/></material></visual>'
    )
    head = '<material name="green"><color rgba="0 0.6 0 1"/></material>'
    path = written(tmp_path, visual, head)
    mesh = load_urdf_link(path, "a", color=(0.9, 0.9, 0.9), packages={"parts": tmp_path})
    box = mesh.vertices[:8]
    assert np.allclose(np.ptp(box, axis=0), (SIDES[1], SIDES[0], SIDES[2]))  # turned by a quarter
    assert np.allclose(box.mean(axis=0), [0.5, 0.0, 0.0])
    assert np.allclose(mesh.face_color[0], [0.8, 0, 0])
    assert np.allclose(mesh.face_color[12:24], [0, 0.6, 0])
    assert np.allclose(mesh.face_color[24], [0.9, 0.9, 0.9])
    assert np.allclose(mesh.face_color[-1], [0.1, 0.2, 0.3])
    round_ones = np.pi * 0.05**2 * 0.2 + 4 / 3 * np.pi * 0.05**3
    assert volume(mesh) == pytest.approx(np.prod(SIDES) + 0.002 + round_ones, rel=0.01)


def test_a_mirrored_mesh_stays_wound_outwards(tmp_path: Path) -> None:
    exported(tmp_path, "box.stl")
    visual = '<visual><geometry><mesh filename="box.stl" scale="1 -1 1"/></geometry></visual>'
    assert volume(load_urdf_link(written(tmp_path, visual), "a")) == pytest.approx(np.prod(SIDES), rel=1e-5)


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ('<mesh filename="box.stl"/>', r"visual 0 of link 'a'.*scale\): .*100 m.*millimetres are suspected"),
        ('<mesh filename="package://parts/box.stl"/>', r"package 'parts', folders are known of \[\]"),
        ('<mesh filename="other.stl"/>', r"no mesh at .*other\.stl"),
        ('<mesh filename="box.stl" scale="0 1 1"/>', "no factor may be 0"),
        ("<cone/>", r"geometry \['cone'\], must be one of box"),
        ('<box size="0.1 0.1"/>', "must be 3 finite numbers"),
    ],
)
def test_bad_visuals_are_named(tmp_path: Path, geometry: str, message: str) -> None:
    exported(tmp_path, "box.stl", 1000.0)
    path = written(tmp_path, f"<visual><geometry>{geometry}</geometry></visual>")
    with pytest.raises(InputError, match=message):
        load_urdf_link(path, "a")


def test_links_that_are_not_there_or_bare(tmp_path: Path) -> None:
    path = written(tmp_path, "")
    with pytest.raises(InputError, match=r"no link 'b'; it has \['a', 'bare'\]"):
        load_urdf_link(path, "b")
    with pytest.raises(InputError, match="no <visual>"):
        load_urdf_link(path, "bare")
    lost = written(tmp_path, '<visual><geometry><box size="1 1 1"/></geometry><material name="x"/></visual>')
    with pytest.raises(InputError, match="refers to material 'x'"):
        load_urdf_link(lost, "a")
