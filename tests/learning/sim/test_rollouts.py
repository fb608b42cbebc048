"""Episodes in the model: an actor that knows the way succeeds, one that does not fails, returns as eq. 24."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.images.appearance import AppearanceSettings
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.sim.rollouts import (
    PER_ACTION,
    ActorRollouts,
    Moment,
    RolloutSettings,
    held,
    new_each_step,
    roll_out,
)
from samrl_core.learning.states.explore import Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.model.model import Model
from samrl_core.policy.planning.expert import label_of
from samrl_core.policy.view.views import sample_views

COUNT = 3


@cache
def renderer() -> BatchRenderer:
    return BatchRenderer(Model(task_named("peg_insertion"), cell_named()))


@cache
def starts() -> Starts:
    model = renderer().model
    rng = np.random.default_rng(0)
    values = np.array([model.task.start_values(rng) for _ in range(COUNT)])
    return Starts(values, np.tile(SceneFrames(model).start_tip, (COUNT, 1)))


@cache
def views() -> np.ndarray:
    return sample_views(renderer().model.task.view_region(), np.random.default_rng(1), COUNT)


class Knowing:
    """Acts as the optimiser, told by the viewer what is drawn; the first `lazy` episodes stand still."""

    def __init__(self, lazy: int = 0) -> None:
        self.lazy, self.states, self.images = lazy, [], []

    def viewer(self, moment: Moment) -> np.ndarray:
        self.states = list(zip(moment.episodes, moment.values, moment.tip_in_base, strict=True))
        block = renderer().frame_names.index("hole_board")
        np.testing.assert_allclose(moment.frames[:, block, 9:11], moment.values, atol=1e-6)
        return views()[moment.episodes]

    def __call__(self, images: torch.Tensor) -> torch.Tensor:
        self.images.append(images.clone())
        model = renderer().model
        actions = [
            np.zeros(3) if episode < self.lazy else label_of(model.dynamics, model.task, values, tip).action
            for episode, values, tip in self.states
        ]
        return torch.from_numpy(np.array(actions))


def run(actor: Knowing, settings: RolloutSettings, seed: int = 0) -> ActorRollouts:
    r = renderer()
    return roll_out(r.model, r, actor, starts(), actor.viewer, settings, np.random.default_rng(seed))


def test_returns_of_success_and_failure() -> None:
    actor = Knowing(lazy=1)
    found = run(actor, RolloutSettings(max_actions=30, discount=0.9))
    assert found.success.tolist() == [False, True, True]
    assert found.actions[0] == 30 and (found.actions[1:] > 8).all() and (found.actions[1:] < 26).all()
    assert len(found.action) == found.actions.sum()
    for episode in range(COUNT):
        mine = found.episode == episode
        count = found.actions[episode]
        np.testing.assert_array_equal(found.step[mine], np.arange(count))
        expected = 0.9 ** np.arange(count - 1, -1, -1) if found.success[episode] else np.zeros(count)
        np.testing.assert_allclose(found.returns[mine], expected)
        np.testing.assert_array_equal(found.view[mine], np.tile(views()[episode], (count, 1)))
        # Where nothing is touched, the tip goes where the action says.
        high = found.tip_in_base[mine][:-1, 2] > 0.06
        way = np.diff(found.tip_in_base[mine], axis=0)
        np.testing.assert_allclose(way[high], found.action[mine][:-1][high], atol=1e-9)
    assert [len(batch) for batch in actor.images[:2]] == [3, 3] and len(actor.images[-1]) == 1
    arrays = {name: getattr(found, name) for name in PER_ACTION}
    assert {len(array) for array in arrays.values()} == {len(found.action)}


def test_the_same_seed_gives_the_same_episodes() -> None:
    settings = RolloutSettings(
        3, action_noise=0.3, appearances=AppearanceSettings(), noise=ImageNoiseSettings()
    )
    first, again, other = (run(Knowing(), settings, seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.action, again.action)
    assert not np.array_equal(first.action, other.action)
    limit = renderer().model.task.action_limit
    assert np.linalg.norm(first.action, axis=1).max() <= limit * (1 + 1e-9)


def test_views_are_held_or_new() -> None:
    r = renderer()
    region = r.model.task.view_region()

    def still(images: torch.Tensor) -> torch.Tensor:
        return torch.zeros((len(images), 3))

    arguments = (r.model, r, still, starts())
    settings = RolloutSettings(max_actions=2)
    same = roll_out(*arguments, held(views()), settings, np.random.default_rng(0))
    np.testing.assert_array_equal(same.view, np.repeat(views(), 2, axis=0))
    new = roll_out(*arguments, new_each_step(region), settings, np.random.default_rng(0))
    assert len(np.unique(new.view[:, 0])) == 2 * COUNT
    assert not same.success.any() and (same.returns == 0).all() and (same.actions == 2).all()


def test_what_cannot_go_on_fails() -> None:
    """A tip beyond the arm's reach, beside a start that is done and one that goes on."""
    r = renderer()
    values = np.array([[0.5, 0.0]] * 3)
    given = Starts(values, np.array([[0.5, 0.0, 0.015], [2.0, 0.0, 0.1], [0.5, 0.0, 0.1]]))

    def still(images: torch.Tensor) -> torch.Tensor:
        return torch.zeros((len(images), 3))

    found = roll_out(
        r.model, r, still, given, held(views()), RolloutSettings(max_actions=2), np.random.default_rng(0)
    )
    assert found.success.tolist() == [True, False, False] and found.actions.tolist() == [0, 0, 2]
    assert set(found.episode) == {2}


def test_wrong_input_is_refused() -> None:
    r = renderer()
    rng = np.random.default_rng(0)

    def broken(images: torch.Tensor) -> torch.Tensor:
        return torch.full((len(images), 3), torch.nan)

    settings = RolloutSettings(max_actions=1)
    with pytest.raises(InputError, match="not finite"):
        roll_out(r.model, r, broken, starts(), held(views()), settings, rng)
    with pytest.raises(InputError, match="views have shape"):
        roll_out(r.model, r, broken, starts(), held(views()[:, :3]), settings, rng)
    with pytest.raises(InputError, match="no start"):
        roll_out(r.model, r, broken, Starts(np.zeros((0, 2)), np.zeros((0, 3))), held(views()), settings, rng)
    with pytest.raises(InputError, match="discount"):
        RolloutSettings(discount=0.0)
    with pytest.raises(InputError, match="at least 0"):
        RolloutSettings(max_actions=-1)
