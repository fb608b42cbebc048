"""Primitive meshes: closed, wound outwards, to size; colour groups of the hole board."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.tasks.peg_insertion.board import SIDE_COLOR, TOP_COLOR, board_body
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Cylinder, SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.scene.color_groups import color_groups, lambert
from samrl_core.model.scene.meshes import box_mesh, face_normals, flatten, frustum_mesh, part_mesh

GREY = (0.5, 0.5, 0.5)


def volume(mesh: SurfaceMesh) -> float:
    """By the divergence theorem; negative when faces are wound inwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_box_has_its_volume() -> None:
    assert volume(box_mesh((0.1, 0.2, 0.3), GREY)) == pytest.approx(8 * 0.1 * 0.2 * 0.3)


def test_frustum_has_its_volume() -> None:
    """Of the prismatoid over a regular polygon: h/3 (A1 + A2 + sqrt(A1 A2))."""
    n, r1, r2, h = 14, 0.05, 0.03, 0.2
    a1, a2 = (0.5 * n * r * r * np.sin(2 * np.pi / n) for r in (r1, r2))
    expected = h / 3 * (a1 + a2 + np.sqrt(a1 * a2))
    assert volume(frustum_mesh(r1, r2, h, GREY, n)) == pytest.approx(expected)


def test_part_is_placed() -> None:
    place = Pose.from_rpy(np.array([1.0, 2.0, 3.0]), (np.pi / 2, 0.0, 0.0))
    mesh = part_mesh(Cylinder(0.01, 0.4, place), GREY)
    assert np.allclose(mesh.vertices.mean(axis=0), [1, 2, 3])
    assert np.ptp(mesh.vertices[:, 1]) == pytest.approx(0.4)


def test_flatten_keeps_surface_and_separates_groups() -> None:
    mesh = box_mesh((1.0, 1.0, 1.0), GREY)
    group = np.arange(12) // 2
    flat = flatten(mesh, group)
    assert (flat.group[flat.faces] == group[:, None]).all()
    assert np.allclose(flat.vertices[flat.faces], mesh.vertices[mesh.faces])


def test_bad_sizes_are_refused() -> None:
    with pytest.raises(InputError, match="half extents"):
        box_mesh((0.1, 0.0, 0.1), GREY)
    with pytest.raises(InputError, match="frustum"):
        frustum_mesh(0.1, 0.1, float("nan"), GREY)


def test_groups_of_the_hole_board() -> None:
    body = board_body("hole_board", 0.012, 0.06, 0.04, Pose.identity(), 1, 0.3)
    groups = color_groups(body, 0.4, np.array([0.0, 0.0, 1.0]))
    assert groups.names == tuple(
        f"hole_board/{n}" for n in ("bore", "bottom", "side_0", "side_1", "side_2", "side_3", "top")
    )
    top, side = groups.names.index("hole_board/top"), groups.names.index("hole_board/side_0")
    assert np.allclose(groups.initial[top], TOP_COLOR)  # lit from straight above
    assert np.allclose(groups.initial[side], 0.4 * np.array(SIDE_COLOR))  # ambient alone
    normals = face_normals(body.mesh.vertices, body.mesh.faces)
    assert (normals[groups.face_group == top, 2] > 0.999).all()
    middle = body.mesh.vertices[body.mesh.faces].mean(axis=1)
    bore = groups.names.index("hole_board/bore")
    assert (np.hypot(*middle[groups.face_group == bore, :2].T) < 0.013).all()


def test_lambert_faces_away_from_the_light() -> None:
    up, down = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    assert np.allclose(lambert(np.stack([up, down]), 0.3, np.array([0, 0, 2.0])), [1.0, 0.3])
