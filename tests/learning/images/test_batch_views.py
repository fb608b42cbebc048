"""Views of many states at once are those that the single search chooses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_core.learning.images.appearance import AppearanceSettings, sample_appearances
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.batch_views import BatchViewAscent, ViewScenes
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate
from samrl_core.policy.view.view_ascent import ViewAscent, ViewAscentSettings
from samrl_core.policy.view.view_reach import ReachSettings, ViewReach
from samrl_core.policy.view.view_search import SearchResult
from tests.policy.view.test_view_ascent import SmoothQ, networks

COARSE = ReachSettings(azimuths=6, elevations=2, distances=1)
SETTINGS = ViewAscentSettings(COARSE, initial_views=4, starts=2, steps=2, min_gain=0.0, time_penalty=1e-3)


@pytest.fixture(scope="module")
def reach(model: Model) -> ViewReach:
    return ViewReach(model.cell, model.task, COARSE)


@pytest.fixture(scope="module")
def scenes(model: Model) -> ViewScenes:
    """Two states of a descent."""
    frames = SceneFrames(model)
    values = np.array([[0.5, 0.0], [0.53, -0.03]])
    tips = np.array([frames.start_tip, [0.53, -0.03, 0.06]])
    joints = np.array([frames.joints(tip) for tip in tips])
    rows = np.array([frames.rows(*pair) for pair in zip(values, joints, strict=True)])
    return ViewScenes(values, tips, rows, joints)


def planned(model: Model, reach: ViewReach, scenes: ViewScenes, q: SmoothQ, chunk: int) -> list[SearchResult]:
    ascent = BatchViewAscent(BatchRenderer(model, chunk=chunk), networks(q), reach, SETTINGS)
    return ascent.plan(scenes, np.tile(model.task.start_joints(model.cell)["camera_arm"], (2, 1)))


def test_as_the_single_search_chooses(model: Model, reach: ViewReach, scenes: ViewScenes) -> None:
    """Same views looked at, same choice, Q within rounding; whatever is drawn at a time."""
    single = ViewAscent(model, model.cell, model.task, networks(SmoothQ()), SETTINGS)
    single._reach = reach
    here = model.task.start_joints(model.cell)["camera_arm"]
    found = planned(model, reach, scenes, SmoothQ(), 128)
    pieces = planned(model, reach, scenes, SmoothQ(), 3)
    moved = 0
    for k, (one, other) in enumerate(zip(found, pieces, strict=True)):
        estimate = replace(initial_estimate(model), values=scenes.values[k])
        choice = single.plan(estimate, scenes.tool_arm_position[k], here)
        assert (choice.move, choice.candidates) == (bool(one.moves), one.views)
        assert other.largest_gain == pytest.approx(one.largest_gain, abs=1e-5)
        for scored in one.moves:
            moved += 1
            np.testing.assert_allclose(scored.view.joint_position, choice.joint_position, atol=2e-3)
            assert scored.q == pytest.approx(choice.score, abs=1e-3)
    assert moved > 0


def test_what_the_networks_do_not_know_is_refused(model: Model, reach: ViewReach, scenes: ViewScenes) -> None:
    with pytest.raises(InputError, match="train them anew"):
        planned(model, reach, scenes, SmoothQ(gain=float("nan")), 128)


def test_the_look_of_a_state_is_drawn(model: Model, reach: ViewReach, scenes: ViewScenes) -> None:
    """In other light Q is another."""

    scored_views = sample_appearances(model, np.random.default_rng(0), 2, AppearanceSettings(plain_share=0.0))
    plain = planned(model, reach, scenes, SmoothQ("colour"), 128)
    varied = planned(model, reach, replace(scenes, appearances=scored_views), SmoothQ("colour"), 128)
    assert all(abs(a.largest_gain - b.largest_gain) > 1e-4 for a, b in zip(plain, varied, strict=True))
