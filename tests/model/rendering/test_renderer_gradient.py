"""Gradients of the renderer against central differences of a 16 x 16 supersampled image."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.model.rendering.renderer import Rendered, Renderer
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.scene.meshes import box_mesh, flatten, frustum_mesh
from samrl_core.studies.speed.thread_scene import ThreadScene, differences, moved, smooth_image

LENS = Intrinsics.from_fov(128, 128, np.deg2rad(42.0))
# Half spans of the differences: 0.3 px to 1 px of motion; camera rotation, translation, object likewise.
SPAN = np.array([2e-3] * 3 + [1.5e-3] * 3 + [1.5e-2] * 3 + [1.5e-3] * 3)


def rods_and_box() -> ThreadScene:
    """Six rods of 5 mm over a table, in colours flat per rod; the target is a two-coloured box among them."""
    rng = np.random.default_rng(3)
    table = np.array([[-0.4, -0.4, 0.0], [0.4, -0.4, 0.0], [0.4, 0.4, 0.0], [-0.4, 0.4, 0.0]])
    vertices, faces, color, part = [table], [np.array([[0, 1, 2], [0, 2, 3]])], [], [np.zeros(4)]
    color.append(np.array([[0.35, 0.3, 0.25], [0.45, 0.4, 0.3], [0.5, 0.45, 0.35], [0.3, 0.3, 0.3]]))
    target = [np.zeros(4)]
    for k in range(7):
        if k < 6:
            mesh = frustum_mesh(0.005, 0.004, 0.06, (0, 0, 0), 10)
            group = np.zeros(len(mesh.faces), dtype=int)
            where = np.array([-0.11 + 0.044 * k, 0.03 * (-1) ** k, 0.06])
            place = Pose.from_rpy(where, (1.2, 0.2 * k, 0.9 * k))
        else:
            mesh = box_mesh((0.03, 0.02, 0.012), (0, 0, 0))
            group = (np.arange(12) >= 8).astype(int)
            place = Pose.from_rpy(np.array([0.01, -0.09, 0.04]), (0.1, -0.2, 0.5))
        flat = flatten(mesh, group)
        faces.append(flat.faces + sum(len(v) for v in vertices))
        vertices.append(place.apply(flat.vertices))
        color.append(rng.uniform(0.1, 0.95, (2, 3))[flat.group])
        part.append(np.full(len(flat.vertices), k + 1))
        target.append(np.full(len(flat.vertices), float(k == 6)))
    v, p = np.concatenate(vertices), np.concatenate(part)
    camera = look_at(np.array([0.05, -0.42, 0.34]), np.array([0.0, -0.02, 0.04])).inverse()
    return ThreadScene(
        torch.from_numpy(v),
        torch.from_numpy(np.concatenate(color)),
        torch.from_numpy(np.concatenate(target)),
        Topology.build(v, np.concatenate(faces), p, p),
        torch.from_numpy(camera.rotation.copy()),
        torch.from_numpy(camera.position.copy()),
    )


def stacked(r: Rendered) -> torch.Tensor:
    return torch.cat([r.color, r.xyz, r.target[..., None]], dim=-1).double()


def smooth_weights(channels: slice) -> torch.Tensor:
    mask = np.zeros(7)
    mask[channels] = 1
    return torch.from_numpy(smooth_image(7) * mask)


@pytest.fixture(scope="module")
def scene() -> ThreadScene:
    return rods_and_box()


@pytest.fixture(scope="module")
def slopes(scene: ThreadScene) -> torch.Tensor:
    """(12, 128, 128, 7) derivative images of the supersampled renderer."""
    fine = Renderer(scene.topology, LENS, supersample=16)
    return differences(lambda p: stacked(moved(scene, fine, p)), SPAN)


def pose_gradient(scene: ThreadScene, weights: torch.Tensor) -> torch.Tensor:
    renderer = Renderer(scene.topology, LENS, supersample=2)
    p = torch.zeros(12, dtype=torch.float64, requires_grad=True)
    (g,) = torch.autograd.grad((stacked(moved(scene, renderer, p)) * weights).sum(), p)
    return g


def test_pose_gradient_matches_differences(scene: ThreadScene, slopes: torch.Tensor) -> None:
    """Mean relative error over blocks (camera and object, rotation and translation) and channels."""
    errors = []
    for channels in (slice(0, 3), slice(3, 6), slice(6, 7)):
        weights = smooth_weights(channels)
        reference = (slopes * weights).sum(dim=(1, 2, 3))
        gradient = pose_gradient(scene, weights)
        for block in range(0, 12, 3):
            part = slice(block, block + 3)
            errors.append(float((gradient[part] - reference[part]).norm() / reference[part].norm()))
    print("relative errors", np.round(errors, 4), "mean", np.mean(errors))
    assert np.mean(errors) < 0.04
    assert np.max(errors) < 0.12


def test_gradient_of_image_residual(scene: ThreadScene, slopes: torch.Tensor) -> None:
    """The residual to a displaced pose, as a least-squares loss has it, gives the descent direction."""
    fine = Renderer(scene.topology, LENS, supersample=16)
    here, there = torch.zeros(12, dtype=torch.float64), torch.from_numpy(2.0 * SPAN)
    with torch.no_grad():
        residual = stacked(moved(scene, fine, here)) - stacked(moved(scene, fine, there))
    reference = (slopes * residual).sum(dim=(1, 2, 3))
    gradient = pose_gradient(scene, residual)
    scale = torch.from_numpy(SPAN)
    a, b = gradient * scale, reference * scale
    assert float((a - b).norm() / b.norm()) < 0.06
    assert float(gradient @ there) < 0


def test_vertex_gradient(scene: ThreadScene) -> None:
    """One free corner of the table and of an unshared box corner, against differences."""
    weights = smooth_weights(slice(0, 6))
    fine, plain = (Renderer(scene.topology, LENS, supersample=s) for s in (16, 2))
    corner = int(torch.nonzero(scene.target)[0])
    same = (scene.vertices - scene.vertices[corner]).norm(dim=1) < 1e-6  # twins move together

    def value(renderer: Renderer, shift: torch.Tensor) -> torch.Tensor:
        v = scene.vertices + same[:, None] * shift
        return (
            stacked(renderer(v, scene.color, scene.target, scene.rotation, scene.translation)) * weights
        ).sum()

    shift = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(value(plain, shift), shift)
    step = 2e-3
    with torch.no_grad():
        eye = step * torch.eye(3, dtype=torch.float64)
        reference = torch.stack([(value(fine, e) - value(fine, -e)) / (2 * step) for e in eye])
    assert float((gradient - reference).norm() / reference.norm()) < 0.06


def test_color_gradient_is_exact(scene: ThreadScene) -> None:
    """The image is linear in the colours."""
    renderer = Renderer(scene.topology, LENS, supersample=2)
    weights = smooth_weights(slice(0, 3))
    color = scene.color.clone().requires_grad_(True)
    direction = torch.from_numpy(np.random.default_rng(0).normal(size=tuple(color.shape)))

    def value(c: torch.Tensor) -> torch.Tensor:
        image = renderer(scene.vertices, c, scene.target, scene.rotation, scene.translation)
        return (stacked(image) * weights).sum()

    (gradient,) = torch.autograd.grad(value(color), color)
    with torch.no_grad():
        reference = float(value(scene.color + direction) - value(scene.color))
    assert float((gradient * direction).sum()) == pytest.approx(reference, rel=1e-4)


def test_color_gradient_of_a_difference_in_one_row() -> None:
    """Two pixels as near to the top of a triangle: its gradient there cancels, those of the others do not."""
    corners = np.array([[0.0, -0.4, 1.0], [-0.4, 0.4, 1.0], [0.4, 0.4, 1.0]])
    faces, label, part = np.array([[0, 1, 2]]), np.ones(3, np.int32), np.zeros(3, np.int32)
    renderer = Renderer(
        Topology.build(corners, faces, label, part), Intrinsics(32, 32, 32.0, 32.0, 16.0, 16.0)
    )
    here, there = torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64)

    def difference(color: torch.Tensor) -> torch.Tensor:
        image = renderer(torch.from_numpy(corners), color, torch.ones(3), here, there).color
        return image[20, 10, 0] - image[20, 22, 0]

    color = torch.full((3, 3), 0.5, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(difference(color), color)
    with torch.no_grad():
        red = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)
        changed = [difference(color + red * at[:, None]) for at in torch.eye(3, dtype=torch.float64)]
    assert abs(float(changed[1])) > 0.4
    torch.testing.assert_close(gradient[:, 0], torch.stack(changed).double(), atol=1e-5, rtol=0.0)
