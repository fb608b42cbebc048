"""A law is named only if it is one law: of one size in every recording and wherever it acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis
from samrl_core.diagnosis.verdict.invariance import (
    DESCRIPTION,
    FORMULA,
    SIGNIFICANCE,
    Sizes,
    invariance_alarms,
    sizes,
)
from tests.diagnosis import worlds
from tests.diagnosis.controllers.kinds import STEPPER
from tests.diagnosis.controllers.machines import Differs
from tests.diagnosis.controllers.machines import worlds as machines
from tests.diagnosis.worlds import LIFT

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of position and velocity [N m]


def sizes_of(values: np.ndarray, deviation: float) -> Sizes:
    """Sizes with independent errors."""
    information = np.eye(len(values)) / deviation**2
    return Sizes("recording", ("in A", "in B", "in C"), information @ values, information)


# -- the statistic --------------------------------------------------------------------------------------


def test_chances_of_an_exact_law_are_uniform() -> None:
    rng = np.random.default_rng(0)
    chances = [sizes_of(1.0 + 0.1 * rng.standard_normal(3), 0.1).chance(0.0) for _ in range(2000)]
    assert stats.kstest(chances, "uniform").pvalue > 0.01


@pytest.mark.parametrize("deviation", [0.01, 0.1, 0.2])
def test_a_law_within_the_allowed_scatter_is_hardly_ever_contradicted(deviation: float) -> None:
    """Groups that are wrong by just what is allowed, whatever the noise."""
    rng = np.random.default_rng(1)
    wrong = FORMULA * np.sqrt(1.5) * np.array([-1.0, 0.0, 1.0])  # of root mean square `FORMULA`
    made = [sizes_of(1.0 + wrong + deviation * rng.standard_normal(3), deviation) for _ in range(2000)]
    assert np.mean([s.chance(FORMULA) < 0.05 for s in made]) < 0.07
    assert np.mean([s.chance(0.5 * FORMULA) < 0.05 for s in made]) > 0.09  # it can contradict


def test_a_factor_of_the_description_is_the_same_in_every_recording() -> None:
    """A weak supply was named a scale of the model: 1.33 times in a slow recording, 0.95 in a fast one."""
    found = sizes_of(np.array([1.33, 0.95]), 0.04)
    assert found.chance(FORMULA) > 0.1  # of a machine, whose formula is not exact
    assert found.chance(DESCRIPTION) < SIGNIFICANCE


def test_groups_that_tolerances_swallow_say_nothing() -> None:
    """Only what differs between the groups is known: their sum is within tolerance."""
    apart = np.array([[1.0, -1.0], [-1.0, 1.0]]) * 100.0
    found = Sizes("recording", ("in A", "in B"), apart @ np.array([1.2, 0.8]), apart)
    assert found.chance(FORMULA) == 1.0


# -- laws on recordings ---------------------------------------------------------------------------------


@cache
def recordings() -> tuple[ArmRecording, ...]:
    """A nominal arm's, noisy, without what the controller was asked: its torques are put in by hand."""
    made = worlds.record(worlds.plant(), "ABC", np.random.default_rng(3))
    return tuple(replace(r, command=None) for r in made)


def alarms_of(family: str, *laws: Law) -> list[str]:
    """Alarms about a family fitted at the second joint of A and B, whose drives lose other torques.

    One law for all recordings, or one for each of A, B and C.
    """
    made = []
    for k, recording in enumerate(recordings()):
        q, v = recording.states.position, recording.states.velocity
        sent = recording.commanded_effort
        assert q is not None and v is not None and sent is not None and sent.effort is not None
        effort = sent.effort.copy()
        effort[:, LIFT] += laws[k % len(laws)](q[:, LIFT], v[:, LIFT])
        made.append(replace(recording, commanded_effort=JointSignal(sent.time, effort=effort)))
    trials, held = arm_trials(made[:2], made[2:])
    whole = Likelihood([*trials, *held])
    fit, k = fitted(family, Likelihood(trials))
    assert np.isfinite(fit.log_evidence)  # one that may be named
    return invariance_alarms(whole, fit, k)


def fitted(family: str, likelihood: Likelihood) -> tuple[Fit, float]:
    """The first form of a family at the second joint, and the samples that count as one."""
    effect, trial = FAMILIES[family], likelihood.trials[0]
    assert isinstance(effect, Effect)
    form = effect.forms(trial, Place.find(trial, "joint:lift"))[0]
    made = hypothesis(likelihood, effect, form, form.shapes[0])
    assert made is not None
    found = Evidence(likelihood, 2.0).fit([made])
    k = max(2.0, min(likelihood.correlation_time(Evidence(likelihood, 2.0).remainder(found)), 25.0))
    return Evidence(likelihood, k).fit([made]), k


@pytest.mark.parametrize("power", [1.0, 0.85], ids=["viscous", "shear-thinning grease"])
def test_a_viscosity_is_one_law_whatever_the_grease(power: float) -> None:
    assert alarms_of("viscous_friction", lambda q, v: 2.0 * np.sign(v) * np.abs(v) ** power) == []


def test_a_drag_by_the_square_of_speed_is_no_viscosity() -> None:
    """It was named viscous friction: a steeper line less a dry friction within tolerance."""
    (alarm,) = alarms_of("viscous_friction", lambda q, v: 3.0 * v * np.abs(v))
    assert alarm.startswith("viscous_friction@joint:lift would have 0.")
    assert "at a speed of" in alarm and "rad/s" in alarm and "formula" in alarm


def test_a_friction_that_is_threefold_in_one_recording_is_no_property_of_the_joint() -> None:
    (alarm,) = alarms_of("viscous_friction", lambda q, v: 2.0 * v, lambda q, v: 0.7 * v, lambda q, v: 0.7 * v)
    assert alarm.endswith("in A: its formula is not what happens")


def test_a_rub_at_one_end_of_the_travel_is_no_friction_of_the_joint() -> None:
    (alarm,) = alarms_of("viscous_friction", lambda q, v: 2.0 * v * (q > worlds.HOME[LIFT]))
    assert "at a position of" in alarm


def test_sizes_are_relative_to_what_was_fitted() -> None:
    trials, _ = arm_trials(list(recordings()[:2]), [])
    likelihood = Likelihood(trials)
    fit, k = fitted("viscous_friction", likelihood)
    for found in sizes(likelihood, fit, 0, k):
        assert found.mean == pytest.approx(1.0, abs=0.2)
        assert len(found.names) == len(found.values)


def test_what_laws_are_compared_along_does_not_hold_the_residuals_own_noise() -> None:
    """A stepper's friction seemed 0.75 to 1.35 times as large where its computed torque was misread."""
    (recordings,) = machines(STEPPER, [Differs()], 1, 4.0)
    trial = arm_trials(recordings[:1], [])[0][0]
    rest, read = trial.residual["dynamics"][:, 0], trial.motion.u
    assert trial.motion.computed and read is not None
    along = trial.drivers("dynamics", 0)["commanded effort"]
    assert abs(np.corrcoef(rest, read[:, 0])[0, 1]) > 0.25
    assert abs(np.corrcoef(rest, along)[0, 1]) < 0.1
    assert np.corrcoef(along, read[:, 0])[0, 1] > 0.7
