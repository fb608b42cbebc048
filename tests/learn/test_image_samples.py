"""Samples that networks learn from: drawn on demand, or from disk; the two show the same."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.errors import InputError
from samrl_core.learn.batch_render import BatchRenderer
from samrl_core.learn.draw_states import draw_states
from samrl_core.learn.explore import ExploreSettings
from samrl_core.learn.image_noise import ImageNoiseSettings
from samrl_core.learn.image_shards import ImageSamples, make_images
from samrl_core.learn.looks import LookSettings
from samrl_core.learn.rendered_samples import DrawSettings, RenderedSamples, Scenes
from samrl_core.learn.samples import ACTION, IMAGE, RETURN
from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named

CPU = torch.device("cpu")
CLEAN = ImageNoiseSettings(clean_share=1.0, lost=0.0, jump_lost=0.0)
PLAIN = LookSettings(plain_share=1.0)
VIEW = np.array([0.6, 0.6, 0.35, 0.5, 0.0, 0.08])


@cache
def renderer() -> BatchRenderer:
    return BatchRenderer(Model(task_named("peg_insertion"), default_cell()), chunk=3)


@cache
def scenes() -> Scenes:
    settings = ExploreSettings(slots=2, longest=4)
    return Scenes.of_states(draw_states(renderer().model, np.random.default_rng(0), 5, settings))


def test_drawn_samples_follow_seed_and_indices() -> None:
    samples = RenderedSamples(scenes(), renderer(), 3)
    assert len(samples) == 5
    batch = samples.batch(np.array([4, 1]), CPU)
    again = samples.batch(np.array([4, 1]), CPU)
    assert batch[IMAGE].shape == (2, 6, 128, 128) and batch[IMAGE].dtype == torch.float32
    assert torch.equal(batch[IMAGE], again[IMAGE])
    np.testing.assert_array_equal(batch[ACTION].numpy(), scenes().targets[ACTION][[4, 1]])
    # Another epoch's batch shows the same state from elsewhere; another seed too.
    assert not torch.equal(samples.batch(np.array([4, 2]), CPU)[IMAGE][0], batch[IMAGE][0])
    other = RenderedSamples(scenes(), renderer(), 4).batch(np.array([4, 1]), CPU)
    assert not torch.equal(other[IMAGE], batch[IMAGE])


def test_a_view_can_be_given() -> None:
    """As a fixed camera has it: nothing else varies, so the images of a state are the same."""
    fixed = replace(scenes(), view=np.tile(VIEW, (5, 1)))
    samples = RenderedSamples(fixed, renderer(), 0, DrawSettings(looks=PLAIN, noise=CLEAN))
    first, second = (samples.batch(np.array(i), CPU)[IMAGE] for i in ([0, 1], [1, 2]))
    torch.testing.assert_close(first[1], second[0])
    expected = renderer().images(scenes().frames[1:2], scenes().tip_in_base[1:2], VIEW[None])
    torch.testing.assert_close(first[1:], expected)


def test_images_from_disk_are_those_drawn(tmp_path: Path) -> None:
    """But for 8 bits of colour, 0.1 mm of depth, and pixels that mix something with nothing."""
    fixed = replace(
        scenes(), view=np.tile(VIEW, (5, 1)), targets={**scenes().targets, RETURN: np.arange(5.0)}
    )
    settings = DrawSettings(looks=PLAIN, noise=CLEAN)
    told: list[int] = []
    make_images(fixed, renderer(), tmp_path, 0, 1, settings, 4, lambda done, wanted: told.append(done))
    assert told == [0, 4, 5]
    loaded = ImageSamples(tmp_path, "peg_insertion", default_cell())
    indices = np.array([3, 0, 4])
    found = loaded.batch(indices, CPU)
    drawn = RenderedSamples(fixed, renderer(), 0, settings).batch(indices, CPU)
    np.testing.assert_array_equal(found[ACTION], drawn[ACTION])
    np.testing.assert_array_equal(found[RETURN], [3.0, 0.0, 4.0])
    difference = (found[IMAGE] - drawn[IMAGE]).abs()
    assert float(difference[:, :3].max()) < 1.01 * 0.5 / 255 / 0.25
    # 0.1 mm of depth, and the mean point of a pixel need not lie on the ray through its centre.
    far = (difference[:, 3:].amax(dim=1) > 0.01).float().mean()
    assert float(far) < 0.01 and float(difference[:, 3:].median()) < 0.001


def test_interrupted_images_are_resumed_to_the_same_bytes(tmp_path: Path) -> None:
    class Interrupted(Exception):
        pass

    def stop(done: int, wanted: int) -> None:
        if done >= 4:
            raise Interrupted

    make_images(scenes(), renderer(), tmp_path / "whole", 2, 2, shard_size=4)
    with pytest.raises(Interrupted):
        make_images(scenes(), renderer(), tmp_path / "parts", 2, 2, shard_size=4, progress=stop)
    assert len(list((tmp_path / "parts").glob("*.npz"))) == 1
    make_images(scenes(), renderer(), tmp_path / "parts", 2, 2, shard_size=4)
    for file in (tmp_path / "whole").iterdir():
        assert file.read_bytes() == (tmp_path / "parts" / file.name).read_bytes()
    samples = ImageSamples(tmp_path / "parts", "peg_insertion", default_cell())
    assert len(samples) == 10 and samples.scene.tolist() == [*range(5), *range(5)]
    views = samples.batch(np.array([0, 5]), CPU)[IMAGE]
    assert float((views[0] - views[1]).abs().mean()) > 0.05, "two views of one state"
    with pytest.raises(InputError, match="another data set"):
        make_images(
            replace(scenes(), targets={ACTION: np.zeros((5, 3))}), renderer(), tmp_path / "parts", 2, 2
        )


def test_noise_is_added_anew(tmp_path: Path) -> None:
    make_images(scenes(), renderer(), tmp_path, 1)
    indices = np.arange(5)
    clean = ImageSamples(tmp_path, "peg_insertion", default_cell()).batch(indices, CPU)[IMAGE]
    noise = ImageNoiseSettings(clean_share=0.0)
    noisy = ImageSamples(tmp_path, "peg_insertion", default_cell(), 1, noise)
    first = noisy.batch(indices, CPU)[IMAGE]
    assert torch.equal(first, noisy.batch(indices, CPU)[IMAGE])
    assert not torch.equal(
        first, ImageSamples(tmp_path, "peg_insertion", default_cell(), 2, noise).batch(indices, CPU)[IMAGE]
    )
    error = (first - clean).abs().mean(dim=(2, 3))
    assert bool((error > 0).all()) and float(error[:, :3].max()) < 0.1


def test_foreign_images_are_refused(tmp_path: Path) -> None:
    make_images(scenes(), renderer(), tmp_path, 1)
    cell = default_cell()
    with pytest.raises(InputError, match="make them anew"):
        ImageSamples(tmp_path, "peg_insertion", replace(cell, intrinsics=replace(cell.intrinsics, fx=100.0)))
    with pytest.raises(InputError, match="not images of task"):
        ImageSamples(tmp_path, "needle_threading", cell)
    with pytest.raises(InputError, match="views_per_state"):
        make_images(scenes(), renderer(), tmp_path, 1, 0)
    with pytest.raises(InputError, match="as many"):
        Scenes(scenes().frames, scenes().tip_in_base[:2], {})
