"""A closed box is sound; each way to break it is counted and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.scene import SurfaceMesh
from samrl_core.common.errors import InputError
from samrl_core.model.scene.mesh_checks import MeshLimits, mesh_faults, require_sound
from samrl_core.model.scene.meshes import box_mesh, frustum_mesh

BOX = box_mesh((0.02, 0.03, 0.05), (0.5, 0.5, 0.5))


def with_faces(faces: np.ndarray, mesh: SurfaceMesh = BOX) -> SurfaceMesh:
    return SurfaceMesh(mesh.vertices, faces.astype(np.int32), np.tile([0.5, 0.5, 0.5], (len(faces), 1)))


def test_a_box_has_no_faults() -> None:
    found = mesh_faults(BOX.vertices, BOX.faces)
    assert (found.flat_faces, found.branching_edges, found.open_edges, found.turned_edges) == (0, 0, 0, 0)
    assert found.volume == pytest.approx(8 * 0.02 * 0.03 * 0.05)
    assert found.extent == pytest.approx(0.1)
    require_sound(BOX, "box")


def test_vertices_that_a_loader_doubled_are_one_point() -> None:
    """As an STL file has it: every triangle with three vertices of its own."""
    vertices = BOX.vertices[BOX.faces].reshape(-1, 3)
    require_sound(SurfaceMesh(vertices, np.arange(36).reshape(12, 3), BOX.face_color), "box")


def test_open_edges_are_counted() -> None:
    opened = with_faces(BOX.faces[1:])
    with pytest.raises(InputError, match=r"mug: 3 open edges.*limit is 0; fill the holes"):
        require_sound(opened, "mug")
    require_sound(opened, "mug", MeshLimits(open_edges=3))


def test_a_branching_edge_is_counted() -> None:
    """A fin on one edge of the box."""
    vertices = np.vstack([BOX.vertices, [[0.1, 0.1, 0.1]]])
    faces = np.vstack([BOX.faces, [[BOX.faces[0, 0], BOX.faces[0, 1], len(vertices) - 1]]])
    finned = SurfaceMesh(vertices, faces.astype(np.int32), np.zeros((13, 3)))
    with pytest.raises(InputError, match=r"1 non-manifold edges.*limit is 0.*split"):
        require_sound(finned, "finned")


def test_degenerate_and_repeated_faces_are_counted() -> None:
    line = [[0, 0, 1]]
    with pytest.raises(InputError, match=r"2 degenerate faces.*limit is 0; delete"):
        require_sound(with_faces(np.vstack([BOX.faces, line, BOX.faces[:1]])), "box")


def test_opposite_winding_is_counted_and_inward_winding_named() -> None:
    faces = BOX.faces.copy()
    faces[0] = faces[0, ::-1]
    with pytest.raises(InputError, match="3 edges between faces of opposite winding"):
        require_sound(with_faces(faces), "box")
    with pytest.raises(InputError, match=r"-0\.00024 m3.*inwards; flip"):
        require_sound(with_faces(BOX.faces[:, ::-1]), "box")


def test_vertices_that_are_not_finite_are_counted() -> None:
    vertices = BOX.vertices.copy()
    vertices[[2, 5], 0] = np.nan
    with pytest.raises(InputError, match=r"box: 2 of 8 vertices are not finite \(vertex 2"):
        require_sound(replace(BOX, vertices=vertices), "box")


def test_no_faces_and_wrong_colors() -> None:
    with pytest.raises(InputError, match="0 faces"):
        require_sound(with_faces(np.zeros((0, 3))), "nothing")
    with pytest.raises(InputError, match="each of the 12 faces three finite"):
        require_sound(replace(BOX, face_color=np.zeros((3, 3))), "box")


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1000.0, r"longest side is 100 m.*2 m; millimetres are suspected \(that would be 0\.1 m\)"),
        (1e-3, r"longest side is 0\.0001 m.*metres read as millimetres are suspected"),
        (1e7, r"longest side is 1e\+06 m, must be 0\.0005 to 2 m; state the file's unit"),
    ],
)
def test_a_wrong_unit_is_suspected(factor: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        require_sound(replace(BOX, vertices=BOX.vertices * factor), "box")


def test_parts_that_touch_are_no_branching() -> None:
    """Two boxes that share an edge: one part has branching edges, two have none."""
    moved = BOX.vertices + [0.04, 0.06, 0.0]
    vertices = np.vstack([BOX.vertices, moved])
    faces = np.vstack([BOX.faces, BOX.faces + 8])
    assert mesh_faults(vertices, faces).branching_edges == 1
    assert mesh_faults(vertices, faces, np.repeat([0, 1], 8)).branching_edges == 0


def test_round_bodies_are_sound() -> None:
    require_sound(frustum_mesh(0.05, 0.03, 0.2, (0.1, 0.2, 0.3)), "cone")
