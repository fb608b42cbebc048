"""What wandering parameters do to the rows, and what is found where they wander and where they do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pushes
import pytest
import torch

from samrl_core.common.errors import InputError
from samrl_core.model.physical_parameters.comparison import PushComparison
from samrl_core.model.physical_parameters.discrepancy import Responses, WanderSettings, responses, wandering
from samrl_core.model.physical_parameters.push_scene import FORCE_RATIO, LATENCY, TABLE_FRICTION, PushScene
from samrl_core.model.physical_parameters.sensitivity import sensitivity
from samrl_core.model.physics.state import PhysicsState

SPREAD = np.array([0.7, 0.5])
TIMES = np.arange(30) * 0.01


Problem = tuple[np.ndarray, np.ndarray, list[Responses]]
NOISE_ALONE = WanderSettings(friction=(0.0,), force=(0.0,))
STILL = WanderSettings(friction=(0.0,), force=(0.0,), time_s=(0.1,))


def problem(possible: WanderSettings, rng: np.random.Generator) -> tuple[Problem, float]:
    """Residual at a truth of 0, Jacobian and responses of two pushes, ways being forces integrated twice; and
    by how much the friction strays.
    """
    twice = np.tril(np.ones((30, 30))) @ np.tril(np.ones((30, 30))) / 450.0
    of_friction, of_force = 300.0 * twice, 100.0 * twice
    friction, force, time_s = (rng.choice(of) for of in (possible.friction, possible.force, possible.time_s))
    kernel = np.linalg.cholesky(np.exp(-np.abs(TIMES[:, None] - TIMES) / time_s) + 1e-9 * np.eye(30))
    residual, rows = [], []
    for stronger in (1.0, 1.6):
        strays = [size * kernel @ rng.standard_normal(30) for size in (friction, force)]
        residual.append(rng.standard_normal(30) + of_friction @ strays[0] + of_force @ strays[1])
        rows.append(np.column_stack([stronger * 400 * twice.sum(axis=1) * TIMES, of_friction.sum(axis=1)]))
    of_pushes = [Responses(of_friction, of_force, TIMES) for _ in range(2)]
    return (np.concatenate(residual), np.vstack(rows), of_pushes), float(friction)


def covered(problems: list[Problem], settings: WanderSettings) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """How often the interval holds the truth (2,), half widths (N, 2), and what wandering was found."""
    inside, widths, found = [], [], []
    for residual, jacobian, of_pushes in problems:
        got = wandering(residual, jacobian, np.zeros(2), np.zeros(2), SPREAD, of_pushes, settings)
        widths.append(1.96 * np.sqrt(np.diag(got.covariance)))
        inside.append(np.abs(got.parameters) < widths[-1])
        found.append(got.friction)
    return np.mean(inside, axis=0), np.array(widths), found


@pytest.mark.thorough
def test_intervals_hold_the_truth_where_contacts_stray() -> None:
    """As often as they should; those of noise alone do not."""
    rng = np.random.default_rng(7)
    problems, frictions = zip(*(problem(WanderSettings(), rng) for _ in range(60)), strict=True)
    share, _, found = covered(list(problems), WanderSettings())
    assert (share > 0.87).all()  # of 60 at 95 %, less than 3 standard deviations below
    assert np.corrcoef(frictions, found)[0, 1] > 0.7
    share, _, _ = covered(list(problems), NOISE_ALONE)
    assert (share < 0.7).all()


def test_white_residuals_leave_little_room_for_straying() -> None:
    """Nothing is found in them, and their intervals are far narrower; never narrower than the noise's."""
    rng = np.random.default_rng(8)
    white = [problem(STILL, rng)[0] for _ in range(10)]
    astray = [problem(replace(STILL, friction=(0.08,), force=(0.04,)), rng)[0] for _ in range(10)]
    _, narrow, none = covered(white, WanderSettings())
    _, wide, some = covered(astray, WanderSettings())
    assert np.median(none) < 0.02 and np.median(some) > 3 * np.median(none)
    assert (2 * np.median(narrow, axis=0) < np.median(wide, axis=0)).all()
    _, alone, _ = covered(white, NOISE_ALONE)
    assert (narrow > 0.99 * alone).all()


def test_responses_are_those_of_a_changed_bin() -> None:
    """All bins together give the parameter's slope; one alone is its own difference."""
    push = pushes.drive(7.0, 0.12, 0.18)
    scene, at = PushScene(pushes.DISC, push, pushes.CONTACT), pushes.theta(0.6, 0.35)
    rows = PushComparison(scene, 1e-4, 1e-3, 0.010)
    found = sensitivity(scene, at)
    got = responses(scene, found, rows, 0.0, 0.010)
    whole = rows.jacobian(found.states.numpy(), found.jacobian.numpy(), 0.0)
    np.testing.assert_allclose(got.friction.sum(axis=1), whole[:, TABLE_FRICTION], rtol=1e-9, atol=1e-9)
    # Before the touch and after the release the arm's force does not wander.
    assert np.abs(got.force[:, 0]).max() == 0.0 and np.abs(got.force[:, -1]).max() == 0.0
    assert np.abs(got.force).max() > 0.1 * np.abs(whole[:, FORCE_RATIO]).max()

    number, h = 8, 1e-5
    per_bin = round(0.010 / scene.model.scene.step_s)

    def ways(change: float) -> np.ndarray:
        state, states = scene.start(at[None]), []
        for t in range(scene.steps):
            states.append(torch.cat([state.q, state.v], dim=-1)[0])
            here = at.clone()
            here[TABLE_FRICTION] += change if t // per_bin == number else 0.0
            with torch.no_grad():
                after = scene.model.step(
                    state, scene.action(here[None], torch.tensor([t])), scene.parameters(here[None])
                )
            state = PhysicsState(after.q, after.v)
        states.append(torch.cat([state.q, state.v], dim=-1)[0])
        return rows.residual(torch.stack(states).numpy(), 0.0)

    expected = (ways(h) - ways(-h)) / (2 * h)
    np.testing.assert_allclose(
        got.friction[:, number], expected, rtol=0.02, atol=1e-3 * np.abs(expected).max()
    )


def test_readings_may_be_later_than_the_drive() -> None:
    """The slope by the latency is the speed, and the residual moves with it."""
    push = pushes.made_push(0.6, 0.35, 7.0, total_s=0.3)
    scene, at = PushScene(pushes.DISC, push, pushes.CONTACT), pushes.theta(0.6, 0.35)
    rows, found = PushComparison(scene, 1e-4, 1e-3, 0.010), sensitivity(scene, pushes.theta(0.6, 0.35))
    states = found.states.numpy()
    jacobian = rows.jacobian(states, found.jacobian.numpy(), 0.0)[:, LATENCY]
    h = 1e-3
    difference = (rows.residual(states, h) - rows.residual(states, -h)) / (2 * h)
    np.testing.assert_allclose(jacobian, difference, rtol=1e-6, atol=1e-6)
    assert np.abs(jacobian).max() > 0.1 / 1e-4  # at 0.1 m/s a second is 0.1 m
    assert at.numel() == LATENCY + 2


@pytest.mark.parametrize(
    "changes", [{"friction": ()}, {"force": (-0.1,)}, {"time_s": (0.0,)}, {"bin_s": -1.0}]
)
def test_impossible_wanderings_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError, match="wander"):
        replace(WanderSettings(), **changes)
