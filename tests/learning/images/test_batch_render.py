"""Images in batches: those of `Model.render`, with other looks and with a camera's noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.images.appearance import AppearanceSettings, model_appearances, sample_appearances
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.policy.networks.network_image import rendered_image
from samrl_core.policy.view.views import cameras_of, sample_views

COUNT = 3


@cache
def scene(name: str) -> tuple[Model, SceneFrames, BatchRenderer]:
    model = Model(task_named(name), cell_named())
    return model, SceneFrames(model), BatchRenderer(model, chunk=2)


@cache
def states(name: str) -> tuple[np.ndarray, ...]:
    """Values, tips, joints, frames and views."""
    model, frames, _ = scene(name)
    rng = np.random.default_rng(5)
    specs = model.task.parameters()
    values = np.array([p.nominal for p in specs]) + np.array([p.scale for p in specs]) * rng.normal(
        size=(COUNT, len(specs))
    )
    tips = frames.start_tip + rng.uniform(-0.03, 0.03, (COUNT, 3))
    joints = np.array([frames.joints(tip) for tip in tips])
    rows = np.array([frames.rows(*pair) for pair in zip(values, joints, strict=True)])
    return values, tips, joints, rows, sample_views(model.task.view_region(), rng, COUNT)


def same(name: str, dtype: type, limit: float) -> None:
    """A few pixels may lie exactly on an edge, and differ by rounding."""
    model, _, renderer = scene(name)
    values, _, joints, rows, views = states(name)
    colors = torch.from_numpy(model.initial_colors())
    batch = renderer.render(rows.astype(dtype), cameras_of(views))
    for k in range(COUNT):
        camera = cameras_of(views[k])
        single = model.render(torch.from_numpy(values[k]), colors, camera, joints[k])
        for field in ("color", "xyz", "target"):
            far = (getattr(batch, field)[k] - getattr(single, field)).abs() > limit
            assert float(far.float().mean()) < 1e-3, (field, k)
        assert float((batch.label[k] != single.label).float().mean()) < 1e-3
        assert (single.label == model.target_label).any(), "the target must be in the picture"


@pytest.mark.parametrize("name", TASKS)
def test_a_batch_is_what_the_model_renders(name: str) -> None:
    same(name, np.float64, 1e-6)
    same(name, np.float32, 1e-5)  # as shards keep the frames


def test_frames_put_the_tip_where_it_was_asked_for() -> None:
    model, _, _ = scene("needle_threading")
    _, tips, joints, _, _ = states("needle_threading")
    for tip, one in zip(tips, joints, strict=True):
        np.testing.assert_allclose(model.tip_in_base(one).position, tip, atol=2e-5)


def test_images_are_what_the_networks_are_given() -> None:
    """In chunks, and one by one through `rendered_image`."""
    model, _, renderer = scene("peg_insertion")
    values, tips, joints, rows, views = states("peg_insertion")
    images = renderer.images(rows, tips, views)
    assert images.shape == (COUNT, 6, 128, 128) and images.dtype == torch.float32
    for k in range(COUNT):
        camera = cameras_of(views[k])
        rendered = model.render(
            torch.from_numpy(values[k]), torch.from_numpy(model.initial_colors()), camera, joints[k]
        )
        torch.testing.assert_close(
            images[k], rendered_image(rendered, camera, tips[k], model.cell), atol=1e-4, rtol=0.0
        )


def test_gradients_reach_the_camera() -> None:
    _, _, renderer = scene("peg_insertion")
    _, _, _, rows, views = states("peg_insertion")
    variable = torch.from_numpy(views).requires_grad_(True)
    renderer.render(rows, cameras_of(variable)).color.mean().backward()
    assert variable.grad is not None and (variable.grad[:, :3].abs() > 0).all()


def test_looks_vary_about_the_models_own() -> None:
    model, _, renderer = scene("spatula_flipping")
    rng = np.random.default_rng(0)
    drawn = sample_appearances(model, rng, 400)
    own = model_appearances(model, 400)
    for part in ("colors", "gain", "towards_light", "ambient"):
        same = (getattr(drawn, part) == getattr(own, part)).reshape(400, -1).all(dim=1)
        assert 0.12 < float(same.float().mean()) < 0.30, part
        assert torch.isfinite(getattr(drawn, part)).all()
    assert float(drawn.colors.min()) >= 0.0 and float(drawn.colors.max()) <= 1.0
    plain = sample_appearances(model, rng, 5, AppearanceSettings(plain_share=1.0))
    torch.testing.assert_close(plain.colors, own.colors[:5])
    _, _, _, rows, views = states("spatula_flipping")
    own_image = renderer.render(rows, cameras_of(views)).color
    few = sample_appearances(model, rng, COUNT, AppearanceSettings(plain_share=0.0))
    other = renderer.render(rows, cameras_of(views), few).color
    assert ((own_image - other).abs().mean(dim=(1, 2, 3)) > 0.01).all()


@pytest.mark.thorough
def test_noise_has_the_stated_size() -> None:
    """The depth's error at 0.4 m is about 0.6 mm along the ray; a share of the images is clean."""
    _, _, renderer = scene("peg_insertion")
    _, tips, _, rows, views = states("peg_insertion")
    many = [np.repeat(a[:1], 60, axis=0) for a in (rows, tips, views)]
    clean = renderer.images(rows[:1], tips[:1], views[:1])
    settings = ImageNoiseSettings(lost=0.0, jump_lost=0.0)

    def draw(seed: int, s: ImageNoiseSettings = settings) -> torch.Tensor:
        generator = torch.Generator().manual_seed(seed)
        return renderer.images(many[0], many[1], many[2], None, s, generator)

    images = draw(0)
    assert torch.equal(images, draw(0)) and not torch.equal(images, draw(1))
    difference = images - clean
    untouched = (difference == 0).reshape(60, -1).all(dim=1)
    assert 0.1 < float(untouched.float().mean()) < 0.5
    near = clean[0, 3:].norm(dim=0) < 1.0  # within 0.1 m of the tip, so about 0.3 to 0.45 m from the camera
    error = 0.1 * difference[:, 3:][:, :, near].norm(dim=1)  # [m]
    typical = float(error.square().mean().sqrt())
    # Level is 2 u in 70 % of the images: its mean square is 0.7 * 4/3.
    expected = float((0.7 * 4 / 3) ** 0.5 * settings.depth * 0.40**2)
    assert 0.5 * expected < typical < 2.0 * expected
    lost = (draw(0, ImageNoiseSettings())[:, 3:] == 0).all(dim=1).float().mean()
    assert 0.001 < float(lost - (clean[:, 3:] == 0).all(dim=1).float().mean()) < 0.1


def test_wrong_input_is_refused() -> None:
    _, _, renderer = scene("peg_insertion")
    _, tips, _, rows, views = states("peg_insertion")
    with pytest.raises(InputError, match="must be"):
        renderer.render(rows[:, :3], cameras_of(views))
    with pytest.raises(InputError, match="must be"):
        renderer.render(rows, cameras_of(views[:1]))
    with pytest.raises(InputError, match="generator"):
        renderer.images(rows, tips, views, noise=ImageNoiseSettings())
    with pytest.raises(InputError, match="chunk"):
        BatchRenderer(renderer.model, chunk=0)
    with pytest.raises(InputError, match="at least 0"):
        ImageNoiseSettings(depth=-1.0)
    with pytest.raises(InputError, match="at least 0"):
        AppearanceSettings(paint=-1.0)
