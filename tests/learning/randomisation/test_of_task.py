"""What a point means in the model: starts, appearances, physical parameters; SimOpt on a real one."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.common.errors import InputError
from samrl_core.learning.images.appearance import model_appearances
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.image_noise import ImageNoiseSettings
from samrl_core.learning.randomisation import of_task
from samrl_core.learning.randomisation.discrepancy import Discrepancy, DiscrepancySettings
from samrl_core.learning.randomisation.distributions import UniformBox
from samrl_core.learning.randomisation.found import FoundSettings, Real2SimUpdated, found_starts
from samrl_core.learning.randomisation.simopt import SimOpt, SimOptSettings
from samrl_core.learning.randomisation.space import Dimension, Space
from samrl_core.learning.randomisation.strategy import QuestionResult
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.state_batch import joined, moved
from samrl_core.learning.states.visited import VisitedStates
from samrl_core.model.model import Model
from samrl_core.model.task_dynamics.physical_parameters import parameters_of, with_factors
from samrl_core.policy.view.views import sample_views


@cache
def model_of(name: str) -> Model:
    return Model(task_named(name), cell_named())


@pytest.mark.parametrize("name", sorted(TASKS))
def test_starts_fill_the_range_that_the_task_declares(name: str) -> None:
    """The box of the starts is what the task samples from, no more and no less."""
    task, rng = task_named(name), np.random.default_rng(0)
    drawn = np.array([task.start_values(rng) for _ in range(400)])
    lower, upper = task.start_range
    assert (drawn >= lower).all() and (drawn <= upper).all()
    np.testing.assert_allclose(drawn.min(axis=0), lower, atol=0.03 * (upper - lower).max())
    np.testing.assert_allclose(drawn.max(axis=0), upper, atol=0.03 * (upper - lower).max())
    space = of_task.starts_of(task)
    points = UniformBox.whole(space).sample(rng, 5)
    values = of_task.start_values(task, space, points)
    assert ((values >= lower) & (values <= upper)).all()
    varied = lower < upper
    np.testing.assert_array_equal(values[:, varied], points)


def test_which_attributes_the_tasks_have() -> None:
    found = {name: parameters_of(model_of(name).dynamics) for name in sorted(TASKS)}
    assert found == {
        "needle_threading": ("friction", "stiffness"),
        "peg_insertion": (),
        "spatula_flipping": ("friction", "mass"),
    }
    peg = model_of("peg_insertion").dynamics
    assert of_task.physical_parameter_space(peg) is None and with_factors(peg, {}) is peg
    with pytest.raises(InputError, match="cannot vary friction"):
        with_factors(peg, {"friction": 2.0})
    with pytest.raises(InputError, match="above 0"):
        with_factors(model_of("spatula_flipping").dynamics, {"mass": 0.0})


def test_looks_of_points(model: Model) -> None:
    """The nominal point looks as the model does; exposure brightens, no noise is no noise."""
    space = of_task.appearances_of(model)
    nominal = np.tile(space.nominal, (3, 1))
    bright = nominal.copy()
    bright[:, space.names.index("look/exposure")] = 0.2
    rng = np.random.default_rng(0)
    own = model_appearances(model, 3)
    same = of_task.AppearancesAt(space, nominal).sample(model, rng, 3)
    brighter = of_task.AppearancesAt(space, bright).sample(model, rng, 3)
    for name, value in vars(own).items():
        torch.testing.assert_close(vars(same)[name], value)
    torch.testing.assert_close(brighter.gain, own.gain * math.exp(0.2))
    with pytest.raises(InputError, match="3 points"):
        of_task.AppearancesAt(space, nominal).sample(model, rng, 2)
    one, again = (
        of_task.AppearancesOf(UniformBox.whole(space)).sample(model, np.random.default_rng(5), 8)
        for _ in "ab"
    )
    torch.testing.assert_close(one.colors, again.colors, rtol=0, atol=0)
    assert float(one.noise.min()) >= 0.0 and float(one.noise.std()) > 0.2


def test_the_factor_on_noise_reaches_the_image(model: Model) -> None:
    frames = SceneFrames(model)
    rows = np.tile(frames.rows(np.array([0.5, 0.0]), frames.joints(frames.start_tip)), (2, 1, 1))
    tips, renderer = np.tile(frames.start_tip, (2, 1)), BatchRenderer(model)
    views = np.tile(sample_views(model.task.view_region(), np.random.default_rng(0), 1), (2, 1))
    looks = replace(model_appearances(model, 2), noise=torch.tensor([0.0, 2.0], dtype=torch.float64))
    noise = ImageNoiseSettings(clean_share=0.0)
    clean = renderer.images(rows, tips, views)
    noisy = renderer.images(rows, tips, views, looks, noise, torch.Generator().manual_seed(3))
    torch.testing.assert_close(noisy[0], clean[0])
    assert float((noisy[1] - clean[1]).abs().mean()) > 1e-3


def test_points_that_move_differently_are_run_apart() -> None:
    space = Space((Dimension("start/a", "m", 0.0, -1.0, 1.0), Dimension("log/friction", "-", 0.0, -1.0, 1.0)))
    points = np.array([[0.1, 0.5], [0.2, -0.5], [0.3, 0.5]])
    groups = of_task.alike(space, points)
    assert sorted(tuple(g) for g in groups) == [(0, 2), (1,)]
    dynamics = model_of("spatula_flipping").dynamics
    with pytest.raises(InputError, match="run those apart"):
        of_task.dynamics_at(dynamics, space, points)
    one = of_task.with_one_set_of_parameters(space, points)
    np.testing.assert_array_equal(one[:, 0], points[:, 0])
    assert len(of_task.alike(space, one)) == 1
    assert len(of_task.alike(space.part([0]), points[:, :1])) == 1


PUSHES = np.array([0.006, 0.008, 0.009, 0.010, 0.010])  # of the pancake's rim, which then slides on [m]
FRICTION = 0.65  # true factor


@cache
def pushes() -> VisitedStates:
    """What estimates would say of pushes on a slippery table: a model of other friction, 0.2 mm off."""
    model, rng = model_of("spatula_flipping"), np.random.default_rng(2)
    slippery = with_factors(model.dynamics, {"friction": FRICTION})
    values = np.tile([p.nominal for p in model.task.parameters()], (len(PUSHES), 1))
    values[:, 0] = rng.uniform(0.47, 0.49, len(PUSHES))
    tips = np.column_stack([values[:, 0] - 0.052, np.zeros(len(PUSHES)), np.full(len(PUSHES), 0.006)])
    actions = np.column_stack([PUSHES, np.zeros((len(PUSHES), 2))])
    start = joined([slippery.start(v, t) for v, t in zip(values, tips, strict=True)])
    after, solved = moved(slippery, start, actions)
    assert solved.all()
    ends = np.array([slippery.read(q)[0] for q in after.q.numpy()])
    both = np.concatenate([values, ends])
    both[:, :2] += 2e-4 * rng.standard_normal((len(both), 2))
    count = len(PUSHES)
    return VisitedStates(
        model.task.name,
        both,
        np.tile(1e-8 * np.eye(5), (2 * count, 1, 1)),
        np.concatenate([tips, tips + actions]),
        np.tile(np.arange(count), 2),
        np.repeat([0, 1], count),
    )


@pytest.mark.thorough
def test_simopt_finds_the_friction_under_a_pushed_pancake() -> None:
    """Three iterations of 16 samples; the factor may be anything from a half to two at first."""
    model = model_of("spatula_flipping")
    space = Space((Dimension("log/friction", "-", 0.0, -math.log(2.0), math.log(2.0)),))
    measure = Discrepancy(model.task, model.dynamics, pushes())
    assert len(measure) == len(PUSHES)
    found, rng = SimOpt.begin(space, settings=SimOptSettings(draws=16)), np.random.default_rng(0)
    costs = []
    for _ in range(3):
        question = found.ask(rng)
        cost = measure.at(space, question.points)
        costs.append(float(cost.mean()))
        found = found.update(QuestionResult(question, cost))
    assert math.exp(float(found.fitted.median[0])) == pytest.approx(FRICTION, rel=0.12)
    assert costs[0] > costs[1] > costs[2] and all(kl <= 1.0 + 1e-9 for kl in found.steps)


def test_what_no_discrepancy_can_be_had_of_is_refused() -> None:
    model, recorded = model_of("spatula_flipping"), pushes()
    with pytest.raises(InputError, match="no action between"):
        Discrepancy(model.task, model.dynamics, recorded.rows(recorded.step == 0))
    measure = Discrepancy(model.task, model.dynamics, recorded)
    with pytest.raises(InputError, match="physical parameters"):
        measure.at(of_task.starts_of(model.task), np.zeros((1, 2)))
    with pytest.raises(InputError, match="not both 0"):
        DiscrepancySettings(0.0, 0.0)


def test_what_real2sim_found_is_begun_with_more_often() -> None:
    """Only how episodes began, and only what varies between starts."""
    task, recorded = task_named("spatula_flipping"), pushes()
    near = recorded.values[0].copy()
    near[:2] = task.center_x + 0.004, -0.006  # ty: ignore[missing-attribute]
    values = np.tile(near, (3, 1))
    values[2, 0] += 0.5  # outside the starts' range
    found = replace(
        recorded.rows(slice(0, 3)), values=values, step=np.array([0, 1, 0]), episode=np.array([0, 0, 1])
    )
    evidence = found_starts(task, found)
    np.testing.assert_array_equal(evidence.question.points, near[None, :2])
    begun = Real2SimUpdated.begin(of_task.starts_of(task), FoundSettings(share=0.4))
    after = begun.update(evidence)
    assert len(after.ask(np.random.default_rng(0))) == 0
    points = after.distribution.sample(np.random.default_rng(0), 2000)
    close = (np.abs(points - near[:2]) <= 0.0002 + 1e-12).all(axis=1).mean()
    assert close == pytest.approx(0.4, abs=0.04)
    assert after.distribution.entropy() < begun.distribution.entropy() - 0.5
