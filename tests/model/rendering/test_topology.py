"""Connectivity of bad meshes: doubled vertices, faces without area, branching surfaces, holes."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.scene.meshes import box_mesh, frustum_mesh

LENS = Intrinsics(64, 48, 50.0, 50.0, 32.0, 24.0)
EYE = (torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64))
LIGHT = Light.of((0.3, -0.4, -1.0), 0.7, 0.3)


def soup(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every face with three vertices of its own, as STL files have it."""
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def build(vertices: np.ndarray, faces: np.ndarray, angle: float = 0.0) -> Topology:
    return Topology.build(vertices, faces, np.ones(len(vertices)), np.zeros(len(vertices)), angle)


def uses_per_edge(t: Topology) -> list[int]:
    return np.bincount(np.diff(t.edge_start)).tolist()


def shift_gradient(vertices: np.ndarray, faces: np.ndarray, light: Light | None = None) -> torch.Tensor:
    """Derivative of a weighted image by a shift of everything."""
    p = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    v = torch.from_numpy(vertices) + p
    r = Renderer(build(vertices, faces), LENS)(
        v, torch.ones(len(vertices), 3), torch.ones(len(vertices)), *EYE, light
    )
    y, x = torch.meshgrid(torch.arange(48.0), torch.arange(64.0), indexing="ij")
    (r.color.sum(dim=-1) * torch.sin(0.2 * x + 0.3 * y)).sum().backward()
    assert p.grad is not None and torch.isfinite(p.grad).all()
    return p.grad


BOX = box_mesh((0.1, 0.12, 0.08), (1, 1, 1))
TILTED = BOX.vertices @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0] + np.array(
    [0.05, 0, 0.8]
)


def test_soup_of_triangles_is_welded() -> None:
    rng = np.random.default_rng(0)
    vertices, faces = soup(TILTED, BOX.faces)
    vertices = vertices + rng.uniform(-2e-7, 2e-7, vertices.shape)  # a writer's rounding
    assert uses_per_edge(build(vertices, faces)) == [0, 0, 18]
    welded, doubled = shift_gradient(TILTED, BOX.faces), shift_gradient(vertices, faces)
    assert float((welded - doubled).norm() / welded.norm()) < 1e-3


def test_vertices_across_a_rounding_border_are_welded() -> None:
    """Nearness counts, not the cell of a grid that a vertex falls into."""
    step = 1e-6
    vertices = np.array([[0, 0, 1.0], [1, 0, 1], [1, 1, 1], [0.5 * step - 1e-9, 0, 1], [1, 1, 1], [0, 1, 1]])
    vertices[0, 0] = 0.5 * step + 1e-9
    assert uses_per_edge(build(vertices, np.array([[0, 1, 2], [3, 4, 5]]))) == [0, 4, 1]


def test_parts_that_touch_are_not_welded() -> None:
    vertices, faces = soup(TILTED, BOX.faces)
    t = Topology.build(vertices, faces, np.zeros(36), np.repeat(np.arange(12), 3))
    assert uses_per_edge(t) == [0, 36]


def test_faces_without_area_change_nothing() -> None:
    middle = 0.5 * (TILTED[0] + TILTED[1])
    vertices = np.concatenate([TILTED, [middle]])
    more = np.concatenate([BOX.faces, [[0, 0, 3], [2, 5, 2], [0, 8, 1]]])
    t = build(vertices, more)
    assert t.dropped.tolist() == [12, 13, 14]
    assert uses_per_edge(t) == [0, 0, 18]
    for light in (None, LIGHT):
        assert torch.equal(shift_gradient(vertices, more, light), shift_gradient(TILTED, BOX.faces, light))
    with pytest.raises(InputError, match="has an area"):
        build(vertices, np.array([[0, 8, 1]]))


def test_surface_that_branches_counts_each_jump_once() -> None:
    """Three sheets at one edge, of one colour; the third lies behind or beyond and its jump is none."""
    sheet = np.array(
        [[-0.2, -0.2, 1], [0, -0.2, 1], [0, 0.2, 1], [-0.2, 0.2, 1], [0.2, -0.2, 1.02], [0.2, 0.2, 1.02]]
    )
    fold = np.concatenate([sheet, [[-0.1, -0.2, 1.1], [-0.1, 0.2, 1.1]]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    branching = np.concatenate([faces, [[1, 6, 7], [1, 7, 2]]])
    assert uses_per_edge(build(fold, branching))[3] == 1
    with_fold, without = shift_gradient(fold, branching), shift_gradient(sheet, faces)
    assert float((with_fold - without).norm() / without.norm()) < 0.01  # where it leaves the edge it is seen


def test_the_same_face_twice_is_the_face_once() -> None:
    doubled = np.concatenate([BOX.faces, BOX.faces[:, ::-1]])
    t = build(TILTED, doubled)
    assert t.dropped.tolist() == list(range(12, 24))
    assert uses_per_edge(t) == [0, 0, 18]
    assert torch.equal(shift_gradient(TILTED, BOX.faces), shift_gradient(TILTED, doubled))


def test_camera_inside_a_body_sees_its_inside() -> None:
    """All pixels see a wall, lit from within like the outside of a wall there; gradients stay finite."""
    vertices = 10 * BOX.vertices
    t = build(vertices, BOX.faces)
    v = torch.from_numpy(vertices).requires_grad_(True)
    towards = Light.of((0.0, 0.0, -1.0), 0.7, 0.3)
    r = Renderer(t, LENS)(v, torch.ones(8, 3), torch.ones(8), *EYE, towards)
    assert torch.equal(r.label, torch.ones_like(r.label))
    assert float(r.depth[24, 32].detach()) == pytest.approx(0.8)
    assert float(r.color[24, 32, 0].detach()) == pytest.approx(
        1.0
    )  # 0.3 + 0.7: the wall ahead faces the camera
    (r.color.sum() + r.xyz.square().sum()).backward()
    assert v.grad is not None and torch.isfinite(v.grad).all() and float(v.grad.abs().max()) > 0


def test_normals_are_shared_below_the_angle_only() -> None:
    """A cylinder's mantle is smooth and its rims are sharp; a box is sharp, a flat mesh shares nothing."""
    tube = frustum_mesh(0.05, 0.05, 0.2, (1, 1, 1), 16)
    t = build(tube.vertices, tube.faces, 0.6)
    assert len(t.normal_start) - 1 == 2 * 16 + 2 * (16 + 1)  # rims of mantle and caps, and the caps' middles
    assert len(build(BOX.vertices, BOX.faces, 0.6).normal_start) - 1 == 6 * 4
    assert len(build(tube.vertices, tube.faces).normal_start) - 1 == len(tube.faces)
    assert t.normal_start[-1] == 3 * len(tube.faces)


def test_smooth_normals_light_a_cylinder_without_facets() -> None:
    """Brightness follows the cosine of the true normal; flat facets step."""
    tube = frustum_mesh(0.1, 0.1, 0.6, (1, 1, 1), 24)
    vertices = np.column_stack([tube.vertices[:, 0], tube.vertices[:, 2], -tube.vertices[:, 1] + 1.0])
    errors = {}
    for angle in (0.0, 0.6):
        t = build(vertices, tube.faces, angle)
        light = Light.of((0.0, 0.0, -1.0), 0.8, 0.1)
        n = len(vertices)
        r = Renderer(t, Intrinsics(64, 48, 200.0, 200.0, 32.0, 24.0))(
            torch.from_numpy(vertices), torch.ones(n, 3), torch.ones(n), *EYE, light
        )
        inside = (r.target > 0.999) & (r.xyz[..., 0].abs() < 0.09)
        cosine = torch.sqrt(1 - (r.xyz[..., 0][inside] / 0.1).clamp(-1, 1) ** 2)
        errors[angle] = float((r.color[..., 0][inside] - (0.1 + 0.8 * cosine)).abs().max())
    assert errors[0.6] < 0.02 < errors[0.0]


def test_bad_meshes_are_refused() -> None:
    with pytest.raises(InputError, match="smooth_angle"):
        build(TILTED, BOX.faces, -0.1)
    with pytest.raises(InputError, match="integers"):
        build(TILTED, BOX.faces.astype(float))
