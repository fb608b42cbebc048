"""What the renderer draws: projection, occlusion, near plane, determinism, refusals."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Rendered, Renderer
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.scene.meshes import box_mesh, flatten

LENS = Intrinsics(64, 48, 50.0, 50.0, 32.0, 24.0)
EYE = (torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64))


def quad(z: float, half: float, x: float = 0.0) -> np.ndarray:
    return np.array([[x - half, -half, z], [x + half, -half, z], [x + half, half, z], [x - half, half, z]])


def draw(quads: list[np.ndarray], target: int, supersample: int = 2, near: float = 0.01) -> Rendered:
    """Quads as parts 0, 1, ... with label and red value part + 1; camera at the origin along +z."""
    n = len(quads)
    vertices = np.concatenate(quads)
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(n)])
    part = np.repeat(np.arange(n), 4)
    renderer = Renderer(Topology.build(vertices, faces, part + 1, part), LENS, supersample, near=near)
    color = torch.zeros((4 * n, 3))
    color[:, 0] = torch.from_numpy(part + 1.0)
    indicator = torch.from_numpy((part == target).astype(np.float32))
    return renderer(torch.from_numpy(vertices), color, indicator, *EYE)


def test_square_falls_where_the_lens_says() -> None:
    """u = fx x / z + cx: a square of 0.2 m at 1 m covers 27..37 by 19..29 px; pixel centres at +0.5."""
    r = draw([quad(1.0, 0.1)], target=0)
    expected = torch.zeros(48, 64)
    expected[19:29, 27:37] = 1.0
    assert torch.allclose(r.target, expected, atol=1e-6)
    assert torch.equal(r.label, expected.to(torch.int32))
    assert torch.isinf(r.depth[expected == 0]).all()
    assert torch.allclose(r.depth[expected == 1], torch.ones(()), atol=1e-6)
    u, v = torch.meshgrid(torch.arange(64) + 0.5, torch.arange(48) + 0.5, indexing="xy")
    rays = torch.stack([(u - 32) / 50, (v - 24) / 50, torch.ones_like(u)], dim=-1)
    assert torch.allclose(r.xyz[expected == 1], rays[expected == 1], atol=1e-6)


def test_partial_coverage_is_area() -> None:
    r = draw([quad(1.0, 0.105)], target=0, supersample=16)
    assert float(r.target.sum()) == pytest.approx(10.5**2, rel=1e-3)


def test_occluder_lowers_target() -> None:
    free = draw([quad(1.0, 0.1), quad(0.5, 0.02, x=5.0)], target=0)
    hidden = draw([quad(1.0, 0.1), quad(0.5, 0.02)], target=0)
    assert float(free.target.sum()) == pytest.approx(100.0)
    assert float(hidden.target.sum()) == pytest.approx(100.0 - 16.0)  # 4 x 4 px
    assert int(hidden.label[24, 32]) == 2
    assert float(hidden.depth[24, 32]) == pytest.approx(0.5)
    assert float(hidden.color[24, 32, 0]) == 2.0


def test_perspective_interpolation_of_color() -> None:
    """On a slanted plane colour is linear in space, not on the screen."""
    vertices = np.array([[-0.5, -1.0, 1.0], [0.5, -1.0, 1.0], [0.5, 1.0, 3.0], [-0.5, 1.0, 3.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    renderer = Renderer(Topology.build(vertices, faces, np.zeros(4), np.zeros(4)), LENS)
    color = torch.from_numpy(np.repeat(vertices[:, 2:], 3, axis=1))
    r = renderer(torch.from_numpy(vertices), color, torch.ones(4), *EYE)
    inside = r.target > 0.999
    assert inside.sum() > 100
    assert torch.allclose(r.color[..., 0][inside], r.xyz[..., 2][inside], atol=1e-5)


def test_floor_that_reaches_behind_the_camera() -> None:
    """A floor 0.1 m below the eye fills everything below the horizon, at depth 0.1 f / (v - cy)."""
    floor = np.array([[-50.0, 0.1, -50.0], [50.0, 0.1, -50.0], [50.0, 0.1, 50.0], [-50.0, 0.1, 50.0]])
    r = draw([floor], target=0, supersample=2, near=0.05)
    assert torch.equal(r.target[:24], torch.zeros(24, 64))
    assert torch.allclose(r.target[25:], torch.ones(23, 64), atol=1e-5)
    v = torch.arange(25, 48) + 0.5
    expected = 0.1 * 50.0 / (v - 24.0)
    assert torch.allclose(r.xyz[25:, 32, 2], expected, rtol=0.01)
    assert torch.isfinite(r.color).all() and torch.isfinite(r.xyz).all()


def test_nothing_nearer_than_the_near_plane() -> None:
    slanted = np.array([[-1.0, -0.2, 0.01], [1.0, -0.2, 0.01], [1.0, 0.2, 2.0], [-1.0, 0.2, 2.0]])
    r = draw([slanted], target=0, near=0.5)
    seen = torch.isfinite(r.depth)
    assert seen.any()
    assert float(r.depth[seen].min()) >= 0.5 - 1e-6
    behind = draw([quad(-1.0, 0.5)], target=0)
    assert float(behind.target.sum()) == 0.0


def test_gradient_stays_finite_across_the_near_plane() -> None:
    floor = np.array([[-5.0, 0.1, -5.0], [5.0, 0.1, -5.0], [5.0, 0.1, 5.0], [-5.0, 0.1, 5.0]])
    topology = Topology.build(floor, np.array([[0, 1, 2], [0, 2, 3]]), np.zeros(4), np.zeros(4))
    vertices = torch.from_numpy(floor).requires_grad_(True)
    r = Renderer(topology, LENS, near=0.05)(vertices, torch.ones(4, 3), torch.ones(4), *EYE)
    (r.color.sum() + r.xyz.sum() + r.target.sum()).backward()
    assert vertices.grad is not None
    assert torch.isfinite(vertices.grad).all()
    assert float(vertices.grad.abs().max()) > 0


def test_doubled_vertices_make_no_silhouette() -> None:
    """A cube in flat colours has as many edges as a cube in one colour."""
    mesh = box_mesh((0.1, 0.1, 0.1), (1.0, 1.0, 1.0))
    flat = flatten(mesh, np.arange(12) // 2)
    assert len(flat.vertices) == 24
    topology = Topology.build(flat.vertices, flat.faces, np.zeros(24), np.zeros(24))
    assert (np.diff(topology.edge_start) == 2).all() and len(topology.edge_start) == 19
    assert (topology.neighbors >= 0).all()


def test_same_input_same_output() -> None:
    rng = np.random.default_rng(0)
    vertices = rng.uniform(-0.3, 0.3, (90, 3)) + np.array([0, 0, 1.0])
    faces = np.arange(90).reshape(30, 3)
    topology = Topology.build(vertices, faces, np.zeros(90), np.zeros(90))
    color = torch.from_numpy(rng.uniform(0, 1, (90, 3)))
    runs = []
    for _ in range(2):
        v = torch.from_numpy(vertices).requires_grad_(True)
        r = Renderer(topology, LENS)(v, color, torch.ones(90), *EYE)
        (r.color.square().sum() + r.xyz.square().sum()).backward()
        assert v.grad is not None
        runs.append((r.color.detach(), r.depth, v.grad))
    for a, b in zip(*runs, strict=True):
        assert torch.equal(a, b)


def test_flat_light_changes_nothing() -> None:
    """Ambient 1 without direction gives the unlit image and gradients, bit by bit; half of it half."""
    mesh = box_mesh((0.1, 0.12, 0.08), (1.0, 1.0, 1.0))
    vertices = mesh.vertices + np.array([0.13, 0.05, 0.8])
    renderer = Renderer(Topology.build(vertices, mesh.faces, np.ones(8), np.zeros(8)), LENS)
    color = torch.from_numpy(np.random.default_rng(0).uniform(0, 1, (8, 3)))
    runs = []
    for light in (None, Light.of((0.0, 0.0, 1.0), 0.0, 1.0), Light.of((0.0, 0.0, 1.0), 0.0, 0.5)):
        v = torch.from_numpy(vertices).requires_grad_(True)
        r = renderer(v, color, torch.ones(8), *EYE, light)
        (r.color.square().sum() + r.xyz.square().sum()).backward()
        runs.append((r.color.detach(), r.xyz.detach(), v.grad))
    for a, b in zip(runs[0], runs[1], strict=True):
        assert torch.equal(a, b)
    assert torch.equal(0.5 * runs[0][0], runs[2][0])


def test_a_side_is_lit_by_its_angle() -> None:
    """A square tilted by 60 degrees to the light: ambient + intensity / 2, seen from either side."""
    square = quad(0.0, 0.2)
    tilt = np.deg2rad(60.0)
    turned = np.column_stack([square[:, 0] * np.cos(tilt), square[:, 1], 1.0 + square[:, 0] * np.sin(tilt)])
    for faces in ([[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]):
        renderer = Renderer(Topology.build(turned, np.array(faces), np.ones(4), np.zeros(4)), LENS)
        light = Light.of((0.0, 0.0, -3.0), 0.8, 0.1)
        r = renderer(torch.from_numpy(turned), torch.ones(4, 3), torch.ones(4), *EYE, light)
        seen = r.target > 0.999
        assert seen.sum() > 50
        assert torch.allclose(r.color[seen], torch.tensor(0.5), atol=1e-5)
    away = Light.of((0.0, 0.0, 1.0), 0.8, 0.1)
    r = renderer(torch.from_numpy(turned), torch.ones(4, 3), torch.ones(4), *EYE, away)
    assert torch.allclose(r.color[seen], torch.tensor(0.1), atol=1e-6)


def test_bad_input_is_refused() -> None:
    square = quad(1.0, 0.1)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    topology = Topology.build(square, faces, np.zeros(4), np.zeros(4))
    renderer = Renderer(topology, LENS)
    v, c, t = torch.from_numpy(square), torch.zeros(4, 3), torch.zeros(4)
    with pytest.raises(InputError, match="vertices"):
        renderer(v * float("nan"), c, t, *EYE)
    with pytest.raises(InputError, match=r"vertices has a non-finite value or one beyond 1e\+06"):
        renderer(v * 1e8, c, t, *EYE)
    with pytest.raises(InputError, match="camera_translation"):
        renderer(v, c, t, EYE[0], torch.full((3,), float("inf")))
    with pytest.raises(InputError, match="color has shape"):
        renderer(v, c[:3], t, *EYE)
    with pytest.raises(InputError, match="supersample"):
        Renderer(topology, LENS, supersample=0)
    with pytest.raises(InputError, match="near"):
        Renderer(topology, LENS, near=0.0)
    with pytest.raises(InputError, match="nothing could be rendered"):
        Topology.build(np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros(0), np.zeros(0))
    with pytest.raises(InputError, match="face index"):
        Topology.build(square, faces + 2, np.zeros(4), np.zeros(4))
    with pytest.raises(InputError, match="must be finite"):
        Topology.build(square * np.nan, faces, np.zeros(4), np.zeros(4))
