"""Samples that networks learn from, drawn on demand."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.data.fit import ACTION, IMAGE
from samrl_core.learning.images.appearance import AppearanceSettings
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.images.rendered_samples import RenderedSamples, SampleSettings, Scenes
from samrl_core.learning.sim.sample_states import StateSource, sample_states
from samrl_core.learning.states.explore import ExploreSettings
from samrl_core.model.model import Model

CPU = torch.device("cpu")
CLEAN = ImageNoiseSettings(clean_share=1.0, lost=0.0, jump_lost=0.0)
PLAIN = AppearanceSettings(plain_share=1.0)
VIEW = np.array([0.6, 0.6, 0.35, 0.5, 0.0, 0.08])


@cache
def renderer() -> BatchRenderer:
    return BatchRenderer(Model(task_named("peg_insertion"), cell_named()), chunk=3)


@cache
def scenes() -> Scenes:
    settings = ExploreSettings(slots=2, longest=4)
    return Scenes.of_states(
        sample_states(renderer().model, np.random.default_rng(0), 5, StateSource(settings))
    )


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
    samples = RenderedSamples(fixed, renderer(), 0, SampleSettings(appearances=PLAIN, noise=CLEAN))
    first, second = (samples.batch(np.array(i), CPU)[IMAGE] for i in ([0, 1], [1, 2]))
    torch.testing.assert_close(first[1], second[0])
    expected = renderer().images(scenes().frames[1:2], scenes().tip_in_base[1:2], VIEW[None])
    torch.testing.assert_close(first[1:], expected)


def test_arrays_of_scenes_must_be_as_many() -> None:
    with pytest.raises(InputError, match="as many"):
        Scenes(scenes().frames, scenes().tip_in_base[:2], {})
