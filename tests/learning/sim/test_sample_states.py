"""Labelled states: usable, widely spread, the same for a seed, and labelled as the cell's planner acts."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.sim.sample_states import StateSource, sample_states
from samrl_core.learning.states.explore import Explorer, ExploreSettings, Starts
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.states import StateSamples
from samrl_core.model.model import Model
from samrl_core.policy.planning.expert import label_of
from samrl_core.policy.planning.trajectory import TrajectorySettings, optimise

QUICK = ExploreSettings(longest=12)


def drawn(model: Model, count: int, seed: int = 0, settings: ExploreSettings = QUICK) -> StateSamples:
    return sample_states(model, np.random.default_rng(seed), count, StateSource(settings))


def check(model: Model, states: StateSamples, count: int) -> None:
    """What holds for the states of every task."""
    assert len(states) == count
    lower, upper = (np.array([getattr(p, n) for p in model.task.parameters()]) for n in ("lower", "upper"))
    assert (states.values >= lower).all() and (states.values <= upper).all()
    lengths = np.linalg.norm(states.action, axis=1)
    assert (lengths <= model.task.action_limit * (1 + 1e-9)).all() and (lengths > 0).all()
    frames = SceneFrames(model)
    for i in range(count):
        values, tip = states.values[i], states.tip_in_base[i]
        assert not model.task.is_done(values, tip)
        assert states.sub_goal[i] in [goal.name for goal in model.task.sub_goals(values, tip)]
        np.testing.assert_allclose(model.tip_in_base(states.tool_arm_position[i]).position, tip, atol=2e-5)
        np.testing.assert_allclose(
            states.frames[i], frames.rows(values, states.tool_arm_position[i]), atol=1e-6
        )


def test_peg_states(model: Model) -> None:
    """Over the hole, at its rim and in it, with labels that lead there."""
    states = drawn(model, 150, settings=ExploreSettings())
    check(model, states, 150)
    assert set(states.sub_goal) == {"above", "inserted"} and states.solved.all()
    assert (states.tip_in_base[:, 2] < 0.039).any(), "some are in the hole"
    lateral = np.linalg.norm(states.tip_in_base[:, :2] - states.values, axis=1)
    assert (lateral < 0.001).mean() > 0.1 and (lateral > 0.01).mean() > 0.1


def test_the_label_is_the_first_action_of_the_planners_own_search(model: Model) -> None:
    """More sub-goals and a longer search begin with the same action."""
    states = drawn(model, 12)
    whole = TrajectorySettings(max_sub_goals=3, max_iterations=3, spare_actions=1)
    for values, tip, action in zip(states.values, states.tip_in_base, states.action, strict=True):
        plan = optimise(model.dynamics, model.task, model.dynamics.start(values, tip), whole)
        np.testing.assert_array_equal(plan.actions[0], action)


def test_a_done_state_has_no_action(model: Model) -> None:
    label = label_of(model.dynamics, model.task, np.array([0.5, 0.0]), np.array([0.5, 0.0, 0.015]))
    assert label.sub_goal == "none" and label.solved
    np.testing.assert_array_equal(label.action, np.zeros(3))


def test_the_same_seed_gives_the_same_states(model: Model) -> None:
    first, again, other = drawn(model, 30, 4), drawn(model, 30, 4), drawn(model, 30, 5)
    for f in fields(StateSamples):
        np.testing.assert_array_equal(getattr(first, f.name), getattr(again, f.name))
    assert not np.array_equal(first.values, other.values)


def test_undisturbed_exploration_follows_the_optimiser(model: Model) -> None:
    """Without noise, visits and errors an episode is the optimiser's: it ends in the hole."""
    settings = ExploreSettings(
        slots=1, wander_share=0.0, visit_share=0.0, exact_share=1.0, exact_values=1.0, stage_share=0.0
    )
    states = drawn(model, 60, 1, settings)
    starts = np.flatnonzero((np.diff(states.values, axis=0) != 0).any(axis=1)) + 1
    assert 2 <= len(starts) <= 5, "episodes of 13 to 25 actions"
    moved = states.tip_in_base[: starts[0]]
    np.testing.assert_allclose(np.diff(moved, axis=0), states.action[: starts[0] - 1], atol=2e-4)


def test_states_that_are_handed_in_are_begun_in(model: Model) -> None:
    """Estimates of Real2Sim, Algorithm 1 lines 16 and 17."""
    given = Starts(np.array([[0.523, 0.017]]), np.array([[0.51, 0.01, 0.09]]))
    settings = replace(QUICK, given_share=1.0, stage_share=0.0, exact_values=1.0)
    states = sample_states(model, np.random.default_rng(0), 20, StateSource(settings, given))
    np.testing.assert_array_equal(states.values, np.tile(given.values, (20, 1)))
    np.testing.assert_array_equal(states.tip_in_base[0], given.tip_in_base[0])
    done = Starts(np.array([[0.5, 0.0]]), np.array([[0.5, 0.0, 0.015]]))
    with pytest.raises(InputError, match="none of 100 starts"):
        sample_states(model, np.random.default_rng(0), 1, StateSource(settings, done))


def test_estimates_err_as_set(model: Model) -> None:
    """The labelled values depart from those that move the model, in half of the states."""
    settings = replace(QUICK, exact_values=0.5, place_error=0.001, stage_share=0.0, longest=200, slots=1)
    explorer = Explorer(
        model.dynamics, model.task, SceneFrames(model).start_tip, np.random.default_rng(2), settings
    )
    seen = [visited.values for visited, _ in zip(explorer.visit(), range(12), strict=False)]
    exact, counts = np.unique(np.round(seen, 12), axis=0, return_counts=True)
    truth = exact[np.argmax(counts)]
    errors = np.abs(np.array(seen) - truth)
    assert 2 <= (errors.max(axis=1) < 1e-9).sum() < 12
    assert 0 < errors.max() < 0.008


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "stages"),
    [("needle_threading", {"above", "thread_1"}), ("spatula_flipping", {"behind", "under"})],
)
def test_other_tasks(name: str, stages: set[str]) -> None:
    model = Model(task_named(name), cell_named())
    settings = ExploreSettings(slots=2, wander_share=0.0, visit_share=0.0, exact_share=1.0)
    states = drawn(model, 26, 1, settings)
    check(model, states, 26)
    assert stages <= set(states.sub_goal) and states.solved.mean() > 0.9


def test_wrong_settings_are_refused(model: Model) -> None:
    with pytest.raises(InputError, match="at least 1"):
        drawn(model, 0)
    with pytest.raises(InputError, match=r"within 0\.\.1"):
        ExploreSettings(stage_share=1.5)
    with pytest.raises(InputError, match="exceed 1 together"):
        ExploreSettings(wander_share=0.7, visit_share=0.7)
    with pytest.raises(InputError, match="smaller first"):
        ExploreSettings(noise=(1.0, 0.1))
    with pytest.raises(InputError, match="one tip each"):
        Starts(np.zeros((2, 2)), np.zeros((1, 3)))
    states = drawn(model, 3)
    with pytest.raises(InputError, match="do not fit"):
        replace(states, action=np.zeros((2, 3)))
    with pytest.raises(InputError, match="not finite"):
        replace(states, action=np.full((3, 3), np.nan))
    with pytest.raises(InputError, match="must hold"):
        StateSamples.from_arrays({"values": np.zeros((1, 2))})
