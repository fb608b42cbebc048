"""TD3: nothing at first, within its bound, from the image, the same after a restart, and no NaN."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.residual.td3 import TD3, TD3Settings
from samrl_core.learning.residual.transitions import Batch
from samrl_core.policy.networks.network_image import CHANNELS
from samrl_core.policy.networks.networks import FEATURES, Encoder

MANY = 10**4  # episodes: nothing is hidden
QUICK = TD3Settings(batch_size=4, n_step=1, warm_up=0, policy_delay=1)
ENCODER = Encoder(CHANNELS, torch.Generator().manual_seed(3))


def batch(seed: int, size: int = 4) -> Batch:
    g = torch.Generator().manual_seed(seed)

    def features() -> torch.Tensor:
        return torch.rand(size, FEATURES, generator=g)

    def vectors() -> torch.Tensor:
        return 0.002 * torch.randn(size, 3, generator=g)

    reward = torch.randint(2, (size,), generator=g).float()
    return Batch(features(), vectors(), vectors(), reward, 0.9 * (1 - reward), features(), vectors(), MANY)


def same(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return a.keys() == b.keys() and all(torch.equal(a[k], b[k]) for k in a)


def test_before_training_the_residual_is_exactly_zero() -> None:
    data = batch(0)
    assert not TD3(QUICK, ENCODER, 0).actor.mean_of_features(data.features, data.nominal).any()


def test_the_actor_waits_for_the_critics() -> None:
    learner = TD3(replace(QUICK, warm_up=3, policy_delay=2), ENCODER, 0)
    turns = [not math.isnan(learner.update_on(batch(k))["actor_value"]) for k in range(7)]
    assert turns == [False, False, False, False, True, False, True]
    data = batch(9)
    assert 0 < learner.actor.mean_of_features(data.features, data.nominal).norm(dim=1).max() <= QUICK.limit


def test_effort_keeps_residuals_short() -> None:
    """A price that no return can pay leaves nothing of them; nothing is priced at zero."""
    lengths = []
    for weight in (0.0, 100.0):
        learner = TD3(replace(QUICK, penalty_weight=weight, actor_lr=1e-3), ENCODER, 0)
        for k in range(12):
            learner.update_on(batch(k % 3))
        data = batch(0)
        lengths.append(
            learner.actor.mean_of_features(data.features, data.nominal).detach().norm(dim=1).mean().item()
        )
    assert lengths[1] < 0.5 * lengths[0]
    with pytest.raises(InputError, match="penalty_weight"):
        replace(QUICK, penalty_weight=-1.0)


@pytest.mark.thorough
def test_the_actor_is_held_to_what_was_tried() -> None:
    """With that alone it comes to the residuals executed, and without it to none."""
    data = replace(
        batch(0, 64), residual=torch.tensor([0.002, -0.001, 0.0]).expand(64, 3), reward=torch.zeros(64)
    )
    tried = []
    for weight in (0.0, 100.0):
        learner = TD3(replace(QUICK, behaviour_cloning_weight=weight, actor_lr=1e-3), ENCODER, 0)
        for _ in range(60):
            learner.update_on(data)
        tried.append(learner.actor.mean_of_features(data.features, data.nominal).detach().mean(dim=0))
    assert (tried[1] - data.residual[0]).norm() < 0.0003 < (tried[0] - data.residual[0]).norm()


@pytest.mark.thorough
def test_the_actor_acts_as_it_learnt_where_updates_see_few_features() -> None:
    """One in five, as after 100 episodes: what is learnt there is not what all features at once give."""
    residual = torch.tensor([0.001, -0.002, 0.0005])
    g = torch.Generator().manual_seed(1)
    features = torch.rand(64, FEATURES, generator=g)
    data = replace(batch(0, 64), features=features, residual=residual.expand(64, 3), reward=torch.zeros(64))
    data = replace(data, episodes=100)
    learner = TD3(replace(QUICK, behaviour_cloning_weight=100.0, actor_lr=1e-3), ENCODER, 0)
    for _ in range(200):
        learner.update_on(data)
    with torch.no_grad():
        acting = learner.actor.mean_of_features(features, data.nominal).mean(dim=0)
        at_once = learner.actor.of_features(features, data.nominal).mean(dim=0)
    print(acting, at_once)
    assert (acting - residual).norm() < 0.1 * residual.norm() < 0.3 * (at_once - residual).norm()
    again = TD3(QUICK, ENCODER, 1)
    again.load_state(learner.state())
    assert torch.equal(again.actor.mean_of_features(features, data.nominal).mean(dim=0), acting)


def test_what_leaving_costs_falls_with_the_root_of_the_episodes() -> None:
    """From `few_episodes` on, all else being equal: a hundred times as many count as a tenth of the price."""
    data = replace(batch(0, 64), features=torch.zeros(64, FEATURES), residual=torch.full((64, 3), 0.001))
    found = []
    for few, weight in ((100.0, 5.0), (10_000.0, 0.5), (10_000.0, 5.0)):
        settings = replace(QUICK, few_episodes=few, behaviour_cloning_weight=weight, actor_lr=1e-3)
        learner = TD3(settings, ENCODER, 0)
        for _ in range(20):
            learner.update_on(replace(data, episodes=10_000))
        found.append(learner.actor.mean_of_features(data.features, data.nominal).detach())
    torch.testing.assert_close(found[0], found[1])
    assert (found[0] - found[2]).norm(dim=1).mean() > 1e-5
    with pytest.raises(InputError, match="few_episodes"):
        replace(QUICK, few_episodes=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 4])
def test_features_that_tell_episodes_apart_hide_nothing(seed: int) -> None:
    """Of 24 episodes, each to be known by its features, those with residuals along +x succeed more often.

    Where all features show, as with many more episodes, the actor hardly moves along x.
    """
    features, nominal, residual, returns = told_apart(seed)
    elsewhere, elsewhere_nominal, *_ = told_apart(seed + 100)
    found = []
    for episodes in (24, MANY):
        learner = TD3(TD3Settings(batch_size=64, behaviour_cloning_weight=0.0), ENCODER, seed)
        none = torch.zeros(64)
        for _ in range(600):
            i = torch.randint(len(returns), (64,), generator=learner.generator)
            some = (features[i], nominal[i])
            learner.update_on(Batch(*some, residual[i], returns[i], none, *some, episodes))
        with torch.no_grad():
            found.append(float(learner.actor.mean_of_features(elsewhere, elsewhere_nominal)[:, 0].mean()))
    print(found)
    assert found[0] > 0.0001 and found[0] > 2.0 * abs(found[1])


def test_updates_see_more_features_the_more_episodes_there_are() -> None:
    """Each row others, and the same as without hiding in the mean."""
    learner = TD3(TD3Settings(episodes_per_feature=4.0), ENCODER, 0)
    features = torch.rand(2000, FEATURES, generator=torch.Generator().manual_seed(1)) + 0.5
    shares = []
    for episodes in (8, 128, 512, MANY):
        dropped = learner._dropout(features, episodes)
        shown = dropped != 0.0
        shares.append(float(shown.float().mean()))
        torch.testing.assert_close(dropped[shown] * min(1.0, episodes / 512), features[shown])
        assert dropped.mean() == pytest.approx(float(features.mean()), rel=0.05)
    assert shares == pytest.approx([2 / FEATURES, 32 / FEATURES, 1.0, 1.0], rel=0.1)
    assert (learner._dropout(features, 128)[0] != 0).any()
    first, second = (learner._dropout(features, 128) for _ in range(2))
    assert ((first != 0.0) != (second != 0.0)).any() and ((first[0] != 0.0) != (first[1] != 0.0)).any()


@pytest.mark.thorough
def test_critics_learn_from_blurred_residuals() -> None:
    """Two steps that residuals tell apart, by 0.2 mm, hardly differ in value where the noise is 1.5 mm."""
    residual = torch.tensor([[0.0001, 0.0, 0.0], [-0.0001, 0.0, 0.0]]).repeat(32, 1)
    data = replace(batch(0, 64), residual=residual, reward=torch.tensor([1.0, 0.0]).repeat(32))
    data = replace(
        data, features=torch.zeros(64, FEATURES), nominal=torch.zeros(64, 3), discount=torch.zeros(64)
    )
    gaps = []
    for noise in (0.0, 0.5):
        learner = TD3(replace(QUICK, action_noise=noise, warm_up=10**6, critic_lr=3e-3), ENCODER, 0)
        for _ in range(200):
            learner.update_on(data)
        with torch.no_grad():
            values = learner.critic(data.features, data.nominal, residual)[0]
        gaps.append(float(values[0] - values[1]))
    assert gaps[0] > 0.5 > 0.2 > gaps[1]


def told_apart(seed: int, episodes: int = 24, length: int = 30) -> tuple[torch.Tensor, ...]:
    """Features, nominal actions, residuals and returns of episodes, step by step."""
    g = torch.Generator().manual_seed(seed)

    def drawn(*size: int) -> torch.Tensor:
        return torch.randn(*size, generator=g)

    tried = 0.0005 * drawn(episodes, 1, 3)
    success = torch.rand(episodes, 1, generator=g) < torch.where(tried[..., 0] > 0, 0.75, 0.25)
    features = 0.3 * drawn(episodes, 1, FEATURES).relu() + 0.03 * drawn(episodes, length, FEATURES)
    returns = success * 0.97 ** torch.arange(length - 1, -1, -1)
    nominal = 0.003 * drawn(episodes, length, 3)
    residual = tried + 0.00005 * drawn(episodes, length, 3)
    return features.flatten(0, 1), nominal.flatten(0, 1), residual.flatten(0, 1), returns.flatten()


def test_the_same_seed_and_batches_give_the_same_weights() -> None:
    learners = [TD3(QUICK, ENCODER, seed) for seed in (0, 0, 1)]
    for learner in learners:
        for k in range(3):
            learner.update_on(batch(k))
    assert same(learners[0].state(), learners[1].state())
    assert not same(learners[0].state(), learners[2].state())


def test_a_restored_learner_goes_on_as_if_nothing_had_been() -> None:
    whole, first = TD3(QUICK, ENCODER, 0), TD3(QUICK, ENCODER, 0)
    for k in range(5):
        whole.update_on(batch(k))
    for k in range(2):
        first.update_on(batch(k))
    second = TD3(QUICK, ENCODER, 7)
    second.load_state({name: value.clone() for name, value in first.state().items()})
    for k in range(2, 5):
        second.update_on(batch(k))
    assert same(whole.state(), second.state())


def test_another_learners_state_is_refused() -> None:
    state = TD3(QUICK, ENCODER, 0).state()
    short = {k: v for k, v in state.items() if k != "generator"}
    bent = {k: v[..., :1] if k == "actor.0.weight" else v for k, v in state.items()}
    for bad in ({}, short, bent):
        with pytest.raises(InputError, match="no state of this learner"):
            TD3(QUICK, ENCODER, 0).load_state(bad)


@pytest.mark.parametrize("where", ["reward", "critic", "actor"])
def test_what_is_not_finite_stops_the_update_before_it_changes_anything(where: str) -> None:
    learner = TD3(QUICK, ENCODER, 0)
    learner.update_on(batch(0))
    data = batch(1)
    if where == "reward":
        data = replace(data, reward=torch.full((4,), math.nan))
    else:
        with torch.no_grad():
            part = {"critic": "first.0.bias", "actor": "head.0.bias"}[where]
            getattr(learner, where).get_parameter(part)[0] = math.nan
    before = {name: value.clone() for name, value in learner.state().items() if name != "generator"}
    with pytest.raises(SolveError, match=r"update 1: the .* loss is"):
        learner.update_on(data)
    after = {name: value for name, value in learner.state().items() if name != "generator"}
    assert before.keys() == after.keys()
    assert all(torch.equal(before[k].nan_to_num(7), after[k].nan_to_num(7)) for k in before)


@pytest.mark.parametrize(
    "bad",
    [
        {"gamma": 1.5},
        {"batch_size": 0},
        {"limit": 0.0},
        {"tau": math.nan},
        {"warm_up": -1},
        {"action_noise": -0.1},
        {"action_noise": math.nan},
        {"penalty_weight": math.inf},
        {"episodes_per_feature": 0.5},
        {"episodes_per_feature": math.nan},
    ],
)
def test_settings_out_of_range_are_refused(bad: dict) -> None:
    with pytest.raises(InputError, match=next(iter(bad))):
        replace(QUICK, **bad)


@pytest.mark.slow
def test_it_learns_what_the_image_tells(tmp_path: Path) -> None:
    """The zero residual never succeeds, and one that ignores the image in half of the states at most.

    A thousand episodes are there from the first update on, so that all features show.
    """
    from tests.learning import toy_cell

    learner = replace(QUICK, batch_size=32, warm_up=240, policy_delay=2, critic_lr=1e-3, actor_lr=5e-4)
    settings = toy_cell.settings(replace(learner, tau=0.05))
    replay = toy_cell.start(tmp_path, settings, 1000)  # zero and noise: one in ten succeeds
    training = toy_cell.training(tmp_path, settings)
    actor = training.learner.actor
    assert toy_cell.rate(actor) == 0.0
    rng = np.random.default_rng(5)
    for _ in range(30):
        assert training.due()
        for _ in range(40):
            training.step()
        toy_cell.act(replay, rng, 20, lambda state: toy_cell.chosen_residual(actor, state), 0.0009, 0.003)
    assert toy_cell.rate(actor) >= 0.9  # measured: 1.0
