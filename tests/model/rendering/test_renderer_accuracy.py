"""Gradients on the thread scene, unlit and lit, against differences of an image of 16 x 16 samples."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.studies.speed.thread_scene import (
    LENS,
    PoseReference,
    ThreadScene,
    differences,
    functionals,
    moved,
    pose_gradients,
    rgb_xyz,
    thread_scene,
)

LIGHT = Light.of((0.4, -0.5, 1.0), 0.7, 0.3)
SMALL, LARGE = (14, 4), (44, 11)  # 2,242 and 19,362 triangles


def check_pose(scene: ThreadScene, light: Light | None, limit: float) -> None:
    reference = PoseReference.of(scene, light)
    errors = reference.errors(pose_gradients(scene, reference, light))
    for name, blocks in errors.items():
        print(len(scene.topology.faces), "triangles", name, np.round(blocks, 4))
    mean = np.mean(list(errors.values()))
    print("mean relative error", mean)
    assert mean <= limit


@pytest.mark.parametrize("light", [None, LIGHT], ids=["unlit", "lit"])
def test_pose_gradient_of_two_thousand_triangles(light: Light | None) -> None:
    check_pose(thread_scene(*SMALL), light, 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("light", [None, LIGHT], ids=["unlit", "lit"])
def test_pose_gradient_of_twenty_thousand_triangles(light: Light | None) -> None:
    check_pose(thread_scene(*LARGE), light, 0.03)


def test_light_gradient() -> None:
    """Direction, intensity and ambient, on flat and smooth normals, against the same image's differences."""
    for angle in (0.0, 1.0):
        scene = thread_scene(*SMALL, smooth_angle=angle)
        weights = functionals(scene, LIGHT)["smooth rgb"]
        renderer = Renderer(scene.topology, LENS, supersample=2)
        zero = torch.zeros(12, dtype=torch.float64)

        def image(p: torch.Tensor) -> torch.Tensor:
            light = Light(LIGHT.towards + p[:3], LIGHT.intensity + p[3], LIGHT.ambient + p[4])
            return rgb_xyz(moved(scene, renderer, zero, light))  # noqa: B023

        p = torch.zeros(5, dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad((image(p) * weights).sum(), p)
        expected = (differences(image, np.full(5, 1e-2)) * weights).sum(dim=(1, 2, 3))
        assert gradient.abs().min() > 0
        assert float((gradient - expected).norm() / expected.norm()) < 2e-3


@pytest.mark.parametrize("light", [None, LIGHT], ids=["unlit", "lit"])
def test_color_gradient(light: Light | None) -> None:
    """The image is linear in the colours; three random directions of all of them."""
    scene = thread_scene(*SMALL)
    weights = functionals(scene, light)["smooth rgb"]
    renderer = Renderer(scene.topology, LENS, supersample=2)
    zero = torch.zeros(12, dtype=torch.float64)

    def value(color: torch.Tensor) -> torch.Tensor:
        placed = ThreadScene(
            scene.vertices, color, scene.target, scene.topology, scene.rotation, scene.translation
        )
        return (rgb_xyz(moved(placed, renderer, zero, light)) * weights).sum()

    color = scene.color.clone().requires_grad_(True)
    (gradient,) = torch.autograd.grad(value(color), color)
    rng = np.random.default_rng(0)
    directions = [torch.from_numpy(rng.normal(size=tuple(color.shape))) for _ in range(3)]
    with torch.no_grad():
        expected = np.array([float(value(scene.color + d) - value(scene.color)) for d in directions])
    got = np.array([float((gradient * d).sum()) for d in directions])
    assert np.linalg.norm(got - expected) / np.linalg.norm(expected) < 1e-4


@pytest.mark.parametrize("light", [None, LIGHT], ids=["unlit", "lit"])
def test_vertex_gradient(light: Light | None) -> None:
    """Waves over all links move every vertex by its own amount; and the table's four corners each alone.

    Seen from near, as the reference's own error is that of samples on the outline.
    """
    scene = thread_scene(*SMALL)
    lens = Intrinsics.from_fov(128, 128, np.deg2rad(14.0))
    fine, plain = (Renderer(scene.topology, lens, supersample=s) for s in (16, 2))
    x = scene.vertices
    link = torch.ones_like(x[:, :1])
    link[:4] = 0.0
    waves = torch.stack(
        [
            torch.cat([torch.sin(20 * x[:, 1:2]), torch.zeros_like(link), torch.zeros_like(link)], dim=1),
            torch.cat([torch.zeros_like(link), torch.cos(15 * x[:, :1]), torch.zeros_like(link)], dim=1),
            torch.cat([torch.zeros_like(link), torch.zeros_like(link), torch.sin(25 * x[:, :1])], dim=1),
        ]
    )
    shifts = [w * link for w in waves]
    for corner in range(4):
        lift = torch.zeros_like(x)
        lift[corner, 2] = 1.0
        shifts.append(lift)
    modes = torch.stack(shifts)

    def image(renderer: Renderer, p: torch.Tensor) -> torch.Tensor:
        v = x + (p[:, None, None] * modes).sum(dim=0)
        return rgb_xyz(renderer(v, scene.color, scene.target, scene.rotation, scene.translation, light))

    span = np.array([2e-3] * 3 + [1e-2] * 4)
    reference = differences(lambda p: image(fine, p), span)
    errors = []
    for name, weights in functionals(scene, light).items():
        if name.startswith("smooth"):
            p = torch.zeros(len(span), dtype=torch.float64, requires_grad=True)
            (gradient,) = torch.autograd.grad((image(plain, p) * weights).sum(), p)
            expected = (reference * weights).sum(dim=(1, 2, 3))
            for part in (slice(0, 3), slice(3, 7)):
                errors.append(float((gradient[part] - expected[part]).norm() / expected[part].norm()))
    print("vertex gradient: waves and table corners, rgb then xyz", np.round(errors, 4))
    assert np.mean(errors) <= 0.02
