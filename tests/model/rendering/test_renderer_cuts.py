"""Jumps that are no mesh edges: bodies that run through each other, and the near plane's cut."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.model.rendering.topology import Topology
from samrl_core.model.scene.meshes import box_mesh

LENS = Intrinsics(96, 80, 110.0, 110.0, 48.0, 40.0)


def weights(channels: int) -> torch.Tensor:
    y, x = torch.meshgrid(torch.arange(80.0), torch.arange(96.0), indexing="ij")
    waves = [
        torch.sin(0.07 * x + 0.11 * y + k) + 0.5 * torch.cos(0.13 * x - 0.05 * y + 2 * k)
        for k in range(channels)
    ]
    return torch.stack(waves, dim=-1).double()


def two_boxes(depth: float) -> tuple[torch.Tensor, torch.Tensor, Topology, torch.Tensor]:
    """A tilted box sunk `depth` into a larger one: vertices, colours, topology, which vertices move."""
    lower = box_mesh((0.3, 0.3, 0.05), (0, 0, 0))
    upper = box_mesh((0.08, 0.06, 0.05), (0, 0, 0))
    place = Pose.from_rpy(
        np.array([0.02, 0.0, 0.05 + 0.05 - depth]), (0.3, -0.2, 0.4) if depth > 0.02 else (0, 0, 0.4)
    )
    v = np.concatenate([lower.vertices, place.apply(upper.vertices)])
    part = np.repeat([0, 1], 8)
    topology = Topology.build(v, np.concatenate([lower.faces, upper.faces + 8]), part, part)
    color = torch.tensor([[0.2, 0.3, 0.8], [0.9, 0.6, 0.1]])[torch.from_numpy(part)]
    return torch.from_numpy(v), color, topology, torch.from_numpy(part == 1)


def shifted_gradients(depth: float, supersample: int = 2) -> tuple[torch.Tensor, torch.Tensor]:
    """Gradient of a functional of the colours by the upper box's shift, and its central differences."""
    v, color, topology, moves = two_boxes(depth)
    eye = look_at(np.array([0.25, -0.5, 0.55]), np.array([0.0, 0.0, 0.06])).inverse()
    camera = (torch.from_numpy(eye.rotation.copy()), torch.from_numpy(eye.position.copy()))
    w = weights(3)

    def value(renderer: Renderer, shift: torch.Tensor) -> torch.Tensor:
        image = renderer(v + moves[:, None] * shift, color, moves.float(), *camera).color
        return (image.double() * w).sum()

    p = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(value(Renderer(topology, LENS, supersample), p), p)
    fine = Renderer(topology, LENS, 16)
    with torch.no_grad():
        steps = 3e-3 * torch.eye(3, dtype=torch.float64)
        expected = torch.stack([(value(fine, s) - value(fine, -s)) / 6e-3 for s in steps])
    return gradient, expected


def test_gradient_where_boxes_run_through_each_other() -> None:
    """The crossings of rows of samples are counted, so that the error falls with the samples' spacing."""
    errors = []
    for supersample in (2, 8):
        gradient, expected = shifted_gradients(0.06, supersample)
        errors.append(float((gradient - expected).norm() / expected.norm()))
    print("sunk box, relative errors with 2 x 2 and 8 x 8 samples", np.round(errors, 4))
    assert errors[0] < 0.06 and errors[1] < 0.03


def test_a_box_that_only_stands_has_its_outline_counted_once() -> None:
    """Exactly touching and sunk by less than rounding allows: sideways motion is that of the outline."""
    for depth, supersample in ((0.0, 2), (1e-6, 2), (1e-4, 2), (1e-4, 8)):
        gradient, expected = shifted_gradients(depth, supersample)
        assert float((gradient - expected)[:2].norm() / expected[:2].norm()) < 0.03


@pytest.mark.parametrize("depth", [0.0, 0.03])
def test_a_gradient_is_the_sum_of_those_of_parts_of_the_image(depth: float) -> None:
    """Pixels without weight are passed over, what their edges claim of pixels beside them is not."""
    v, color, topology, moves = two_boxes(depth)
    eye = look_at(np.array([0.25, -0.5, 0.55]), np.array([0.0, 0.0, 0.06])).inverse()
    camera = (torch.from_numpy(eye.rotation.copy()), torch.from_numpy(eye.position.copy()))
    p = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    image = Renderer(topology, LENS, 2)(v + moves[:, None] * p, color, moves.float(), *camera).color
    w = weights(3).float()

    def gradient(weight: torch.Tensor) -> torch.Tensor:
        return torch.autograd.grad(image, p, weight, retain_graph=True)[0]

    whole = gradient(w)
    cells = (torch.arange(80)[:, None] + torch.arange(96))[..., None] % 2
    parts = [gradient(w * (cells == k)) for k in range(2)]
    assert all(float(part.norm()) > 0.01 * float(whole.norm()) for part in parts)
    torch.testing.assert_close(sum(parts), whole, rtol=0.0, atol=1e-6 * float(whole.norm()))


def test_gradient_of_the_near_cut() -> None:
    """A box that reaches through the near plane is cut open; what its inside and the wall behind show."""
    wall = np.array([[-3.0, -3, 2], [3, -3, 2], [3, 3, 2], [-3, 3, 2]])
    bar = Pose.from_rpy(np.array([0.02, 0.01, 0.3]), (0.5, 0.4, 0.2)).apply(
        box_mesh((0.05, 0.04, 0.25), (0, 0, 0)).vertices
    )
    v = torch.from_numpy(np.concatenate([wall, bar]))
    faces = np.concatenate([[[0, 1, 2], [0, 2, 3]], box_mesh((1, 1, 1), (0, 0, 0)).faces + 4])
    part = np.repeat([0, 1], [4, 8])
    topology = Topology.build(v.numpy(), faces, part, part)
    color = torch.cat([torch.full((4, 3), 0.2), torch.tensor([[0.9, 0.5, 0.1]] * 4 + [[0.3, 0.9, 0.6]] * 4)])
    moves = torch.from_numpy(part == 1)
    eye = (torch.eye(3, dtype=torch.float64), torch.zeros(3, dtype=torch.float64))
    w = weights(3)

    def value(renderer: Renderer, shift: torch.Tensor) -> torch.Tensor:
        r = renderer(v + moves[:, None] * shift, color, moves.float(), *eye)
        assert float(r.depth.detach().min()) == pytest.approx(0.2, rel=0.02)  # the cut is in the image
        return (r.color.double() * w).sum()

    fine = Renderer(topology, LENS, 16, near=0.2)
    with torch.no_grad():
        steps = 1e-3 * torch.eye(3, dtype=torch.float64)
        expected = torch.stack([(value(fine, s) - value(fine, -s)) / 2e-3 for s in steps])
    errors = []
    for supersample in (2, 8):
        p = torch.zeros(3, dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(value(Renderer(topology, LENS, supersample, near=0.2), p), p)
        errors.append(float((gradient - expected).norm() / expected.norm()))
    print("near cut, relative errors with 2 x 2 and 8 x 8 samples", np.round(errors, 4))
    assert errors[0] < 0.12 and errors[1] < 0.04
