"""A training's strategy: what it samples, what it learns on the way, and going on where it was."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.learning.data.shards import MANIFEST
from samrl_core.learning.images.appearance import AppearanceSettings
from samrl_core.learning.randomisation.adr import AdrSettings
from samrl_core.learning.randomisation.distributions import UniformBox
from samrl_core.learning.randomisation.of_task import (
    AppearancesOf,
    physical_parameter_space,
    starts_of,
    together,
)
from samrl_core.learning.randomisation.simopt import SimOptSettings
from samrl_core.learning.sim import randomising
from samrl_core.learning.sim.episodes import EpisodeGroup, begun, run_groups
from samrl_core.learning.sim.prepare import prepare_states
from samrl_core.learning.sim.randomising import Randomising
from samrl_core.learning.sim.sample_states import StateSource
from samrl_core.learning.sim.train import CONFIG, SUMMARY, train
from samrl_core.learning.states.explore import ExploreSettings
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.rigid_task_dynamics import TaskPhysics
from samrl_core.policy.networks.networks import SimActor
from tests.learning.randomisation.test_of_task import FRICTION, model_of, pushes
from tests.learning.sim.test_train import SMALL
from tests.learning.states.test_visited import visited

PEG = "peg_insertion"
TINY = replace(SMALL, max_actions=2, adr=AdrSettings(buffer=1, episodes=3, questions=2))


def silent(stage: str, row: dict[str, float]) -> None:
    """Nobody listens."""


def actor_of(model: Model) -> SimActor:
    return SimActor(model.task.action_limit, torch.Generator().manual_seed(1)).eval()


def test_adr_learns_from_actors_and_goes_on_where_it_was(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An actor that knows nothing fails within two actions: the box stays. One that succeeds: it grows."""
    settings = replace(TINY, randomisation="adr")
    failing = Randomising(model, settings, tmp_path / "f", None, silent)
    before = failing.distribution
    assert isinstance(before, UniformBox) and isinstance(failing.appearances, AppearancesOf)
    failing.before_training()
    failing.after_actor(actor_of(model))
    assert len(list((tmp_path / "f" / "randomisation").glob("evidence-*.npz"))) == 2
    assert failing.summary()["entropy"] == [before.entropy()] * 3

    def succeed(task: str, actor: SimActor, groups: list[EpisodeGroup], *rest: Any) -> Any:
        return [{"success": np.ones(group.count, dtype=bool)} for group in groups]

    monkeypatch.setattr(randomising, "run_cached_groups", succeed)
    growing = Randomising(model, settings, tmp_path / "g", None, silent)
    growing.after_actor(actor_of(model))
    entropies = growing.summary()["entropy"]
    assert entropies[0] < entropies[1] < entropies[2]

    def never(*given: Any) -> Any:
        raise AssertionError("what was tried is not tried again")

    monkeypatch.setattr(randomising, "run_cached_groups", never)
    again = Randomising(model, settings, tmp_path / "g", None, silent)
    again.after_actor(actor_of(model))
    assert again.summary() == growing.summary()
    other = Randomising(model, replace(settings, seed=1), tmp_path / "g", None, silent)
    with pytest.raises(InputError, match="answers another question"):
        other.after_actor(actor_of(model))


@pytest.mark.thorough
def test_simopt_learns_before_training(tmp_path: Path) -> None:
    """From the cell's pushes; the physical parameters of what is sampled then are near those of the cell."""
    model = model_of("spatula_flipping")
    settings = replace(SMALL, randomisation="simopt", simopt=SimOptSettings(draws=12))
    found = Randomising(model, settings, tmp_path, pushes(), silent)
    found.before_training()
    assert found.distribution is not None and found.summary()["questions"] == 3
    space = found.distribution.space
    points = found.distribution.sample(np.random.default_rng(0), 500)
    friction = np.exp(points[:, space.names.index("log/friction")])
    assert abs(np.median(friction) - FRICTION) < 0.15 and np.median(friction) < 0.85
    assert friction.std() < 0.2  # 0.39 at first
    again = Randomising(model, settings, tmp_path, pushes(), silent)
    again.before_training()
    assert again.summary() == found.summary()
    json.dumps(found.summary())


def test_real2sim_draws_as_ever_until_something_was_found(model: Model, tmp_path: Path) -> None:
    plain = Randomising(model, SMALL, tmp_path, None, silent)
    assert plain.distribution is None and plain.appearances == AppearanceSettings()
    found = Randomising(model, SMALL, tmp_path, visited(), silent)
    assert found.distribution is not None and found.appearances == AppearanceSettings()
    assert found.summary()["strategy"] == "real2sim" and not list(tmp_path.iterdir())


def test_what_cannot_be_randomised_so_is_refused(model: Model, tmp_path: Path) -> None:
    for settings, seen, words in (
        (replace(SMALL, randomisation="simopt"), visited(), "no physical parameter"),
        (replace(SMALL, randomisation="uniform"), visited(), "leave the visited ones out"),
        (replace(SMALL, randomisation="adr", rounds=0), None, "between rounds"),
    ):
        with pytest.raises(InputError, match=words):
            Randomising(model, settings, tmp_path, seen, silent)
    with pytest.raises(InputError, match="compares the model with the cell"):
        settings = replace(SMALL, randomisation="simopt")
        Randomising(model_of("spatula_flipping"), settings, tmp_path, None, silent)
    with pytest.raises(InputError, match="real2sim, uniform, adr, simopt"):
        replace(SMALL, randomisation="chaos")


def test_states_begin_where_the_distribution_says(tmp_path: Path, model: Model) -> None:
    space = starts_of(model.task)
    narrow = UniformBox(space, np.array([0.46, 0.02]), np.array([0.462, 0.022]))
    settings = ExploreSettings(slots=2, longest=5, exact_values=1.0)
    states = prepare_states(PEG, 40, tmp_path, 3, 1, StateSource(settings, distribution=narrow))
    assert (states.values >= narrow.lower).all() and (states.values <= narrow.upper).all()
    assert json.loads((tmp_path / MANIFEST).read_text())["settings"]["drawn"] == narrow.record()
    with pytest.raises(InputError, match="another data set"):
        prepare_states(PEG, 40, tmp_path, 3, 1, StateSource(settings))


def test_episodes_begin_at_their_points(model: Model) -> None:
    """In the order of the points; the same group gives the same episodes."""
    space = starts_of(model.task)
    points = np.array([[0.46, 0.02], [0.54, -0.03]])
    group = EpisodeGroup(0, ("round",), 2, False, 0.0, True, 1, UniformBox.whole(space), points)
    ((_, one),) = run_groups(PEG, actor_of(model), [group], "cpu", 1)
    np.testing.assert_allclose(one.values, points)
    distribution = replace(group, points=None)
    ((_, first),) = run_groups(PEG, actor_of(model), [distribution], "cpu", 1)
    ((_, again),) = run_groups(PEG, actor_of(model), [distribution], "cpu", 1)
    np.testing.assert_array_equal(first.values, again.values)
    assert not np.allclose(first.values, points)


def test_a_group_moves_with_the_attributes_of_its_points() -> None:
    """Given or sampled; a group has one set of them."""
    model = model_of("spatula_flipping")
    attributes = physical_parameter_space(model.dynamics)
    assert attributes is not None and isinstance(model.dynamics, TaskPhysics)
    space = together(starts_of(model.task), attributes)
    assert space.names == ("start/pancake_x", "start/pancake_y", "log/friction", "log/mass")
    points = np.array([[0.51, 0.0, -math.log(2.0), 0.0], [0.50, 0.0, -math.log(2.0), 0.0]])
    group = EpisodeGroup(0, ("round",), 2, False, 0.0, False, 0, UniformBox.whole(space), points)
    values, looks, dynamics = begun(model, group, np.random.default_rng(0))
    assert isinstance(dynamics, TaskPhysics) and looks == AppearanceSettings()
    np.testing.assert_array_equal(values[:, 0], points[:, 0])
    own = model.dynamics.parameters
    torch.testing.assert_close(dynamics.parameters.friction, 0.5 * own.friction)
    torch.testing.assert_close(dynamics.parameters.mass, own.mass)
    _, _, distribution = begun(model, replace(group, points=None), np.random.default_rng(0))
    assert isinstance(distribution, TaskPhysics)
    assert not torch.allclose(distribution.parameters.friction, own.friction)
    with pytest.raises(InputError, match="run those apart"):
        differing = points + np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.1, 0.0]])
        begun(model, replace(group, points=differing), np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["uniform", "adr"])
def test_a_whole_training(name: str, tmp_path: Path) -> None:
    """As small as can be; stopped before the episodes, then the rest."""

    class Stop(Exception):
        pass

    def stop(stage: str, row: dict[str, float]) -> None:
        if stage == "episodes":
            raise Stop

    settings = replace(SMALL, randomisation=name, adr=AdrSettings(buffer=1, episodes=2, questions=1))
    with pytest.raises(Stop):
        train(PEG, tmp_path, settings, stop)
    assert json.loads((tmp_path / CONFIG).read_text())["randomisation"] == name
    summary = train(PEG, tmp_path, settings)
    assert summary["randomisation"]["strategy"] == name
    assert summary["randomisation"]["questions"] == (1 if name == "adr" else 0)
    assert json.loads((tmp_path / SUMMARY).read_text())["randomisation"] == summary["randomisation"]
    with pytest.raises(InputError, match="randomisation"):
        train(PEG, tmp_path, SMALL)
