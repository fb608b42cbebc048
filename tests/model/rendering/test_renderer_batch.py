"""Many images in one call: equal to one by one, in values and gradients, with any number of threads."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.common.errors import InputError
from samrl_core.model.rendering.light import Light
from samrl_core.model.rendering.renderer import Renderer
from samrl_core.studies.speed.thread_scene import ThreadScene, rgb_xyz, thread_scene, turn

LENS = Intrinsics.from_fov(50, 38, np.deg2rad(45.0))  # neither square nor a power of two
COUNT = 5


@pytest.fixture(scope="module")
def scene() -> ThreadScene:
    return thread_scene(8, 2)


def states(scene: ThreadScene) -> dict[str, torch.Tensor]:
    """Every argument with its own value per image."""
    rng = np.random.default_rng(2)

    def noise(*shape: int) -> torch.Tensor:
        return torch.from_numpy(rng.normal(size=shape))

    return {
        "vertices": scene.vertices + 0.004 * noise(COUNT, *scene.vertices.shape),
        "color": (scene.color + 0.05 * noise(COUNT, *scene.color.shape)).clamp(0, 1),
        "target": scene.target.expand(COUNT, -1).clone(),
        "camera_rotation": torch.stack([turn(0.02 * noise(3)) @ scene.rotation for _ in range(COUNT)]),
        "camera_translation": scene.translation + 0.02 * noise(COUNT, 3),
        "towards": torch.tensor([0.3, -0.4, 1.0], dtype=torch.float64) + 0.2 * noise(COUNT, 3),
        "intensity": 0.7 + 0.1 * noise(COUNT).clamp(-1, 1),
        "ambient": 0.3 + 0.1 * noise(COUNT).clamp(-1, 1),
    }


def run(renderer: Renderer, arguments: dict[str, torch.Tensor], lit: bool) -> tuple[torch.Tensor, ...]:
    """Image, depth, label and the gradients of every argument."""
    leaves = {k: v.clone().requires_grad_(True) for k, v in arguments.items()}
    light = Light(leaves["towards"], leaves["intensity"], leaves["ambient"]) if lit else None
    names = ("vertices", "color", "target", "camera_rotation", "camera_translation")
    r = renderer(*(leaves[n] for n in names), light)
    image = torch.cat([rgb_xyz(r), r.target[..., None]], dim=-1)
    y, x, c = torch.meshgrid(*(torch.arange(n) for n in image.shape[-3:]), indexing="ij")
    (image * torch.sin(0.1 * x + 0.17 * y + c)).sum().backward()
    grads = [v.grad for v in leaves.values() if v.grad is not None]
    assert len(grads) == (8 if lit else 5)
    return image.detach(), r.depth, r.label, *grads


@pytest.mark.parametrize("lit", [False, True], ids=["unlit", "lit"])
def test_batch_equals_one_by_one(scene: ThreadScene, lit: bool) -> None:
    renderer = Renderer(scene.topology, LENS)
    together = states(scene)
    batch = run(renderer, together, lit)
    assert batch[0].shape == (COUNT, 38, 50, 7) and batch[2].shape == (COUNT, 38, 50)
    assert not torch.equal(batch[0][0], batch[0][1])
    for k in range(COUNT):
        single = run(renderer, {n: v[k] for n, v in together.items()}, lit)
        for a, b in zip(batch[:3], single[:3], strict=True):
            assert torch.equal(a[k], b)
        for a, b in zip(batch[3:], single[3:], strict=True):  # torch multiplies matrices in another order
            assert torch.allclose(a[k], b, rtol=1e-12, atol=1e-12 * float(b.abs().max()))


@pytest.mark.parametrize("lit", [False, True], ids=["unlit", "lit"])
def test_threads_change_nothing(scene: ThreadScene, lit: bool) -> None:
    together = states(scene)
    one = run(Renderer(scene.topology, LENS), together, lit)
    for threads in (2, 3, 16):
        several = run(Renderer(scene.topology, LENS, threads=threads), together, lit)
        assert all(torch.equal(a, b) for a, b in zip(one, several, strict=True))


def test_shared_arguments_get_the_sum_of_gradients(scene: ThreadScene) -> None:
    """One set of vertices and colours under B cameras, and one camera over B sets of vertices."""
    renderer = Renderer(scene.topology, LENS)
    together = states(scene)
    for own in (("camera_rotation", "camera_translation", "towards"), ("vertices",)):
        mixed = {n: v if n in own else v[0] for n, v in together.items()}
        batch = run(renderer, mixed, True)
        singles = [
            run(renderer, {n: v[k] if n in own else v for n, v in mixed.items()}, True) for k in range(COUNT)
        ]
        assert torch.equal(batch[0], torch.stack([s[0] for s in singles]))
        for position, name in enumerate(mixed):
            each = torch.stack([s[3 + position] for s in singles])
            expected = each if name in own else each.sum(dim=0)
            # Single precision inside, so that sums in another order differ by rounding.
            assert torch.allclose(
                batch[3 + position], expected, rtol=1e-5, atol=1e-5 * float(expected.abs().max())
            )


def test_bad_batches_are_refused(scene: ThreadScene) -> None:
    renderer = Renderer(scene.topology, LENS)
    s = states(scene)
    plain = (scene.color, scene.target, scene.rotation, scene.translation)
    with pytest.raises(InputError, match="differ or are empty"):
        renderer(s["vertices"], s["color"][:2], *plain[1:])
    with pytest.raises(InputError, match="differ or are empty"):
        renderer(s["vertices"][:0], *plain)
    with pytest.raises(InputError, match="vertices has shape"):
        renderer(s["vertices"][None], *plain)
    with pytest.raises(InputError, match="threads"):
        Renderer(scene.topology, LENS, threads=0)
    for light, what in (
        (Light.of((0.0, 0.0, 0.0), 0.5, 0.5), "some length"),
        (Light.of((0.0, 0.0, 1.0), -0.5, 0.5), "not negative"),
        (Light.of((0.0, float("nan"), 1.0), 0.5, 0.5), "finite"),
        (Light(torch.zeros(2), torch.zeros(()), torch.zeros(())), "light has shapes"),
        (Light(torch.ones(3, 3), torch.zeros(2), torch.zeros(())), "light has shapes"),
    ):
        with pytest.raises(InputError, match=what):
            renderer(scene.vertices, *plain, light)
