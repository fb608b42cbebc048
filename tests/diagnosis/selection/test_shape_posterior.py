"""Intervals follow the likelihood: wide where shapes trade with amplitudes, narrow where data pin them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.effects.friction.position_dependent_friction import EFFECT as WAVES
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import ParameterEstimate
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis
from samrl_core.diagnosis.selection.shape_posterior import Profile, shape_posterior
from samrl_core.diagnosis.verdict.confidence import estimates
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT

LEVEL, SIZE, PHASE, TURN = 1.2, 0.8, 0.4, 0.01  # [N m], [rad], [rad/s]


@cache
def recordings(seed: int) -> tuple[ArmRecording, ...]:
    """A nominal arm with a background in A and B, without what the controller was asked."""
    return tuple(replace(r, command=None) for r in worlds.world(seed, "AB"))


def waving(order: float, start: float, seed: int = 5) -> tuple[Evidence, Fit]:
    """A friction that waves over the second joint's angle, fitted from another order; 1 rad of travel."""
    made = []
    for recording in recordings(seed):
        q, v, sent = recording.states.position, recording.states.velocity, recording.commanded_effort
        assert q is not None and v is not None and sent is not None and sent.effort is not None
        effort = sent.effort.copy()
        size = LEVEL + SIZE * np.sin(order * q[:, LIFT] + PHASE)
        effort[:, LIFT] += size * np.tanh(v[:, LIFT] / TURN)
        made.append(replace(recording, commanded_effort=JointSignal(sent.time, effort=effort)))
    likelihood = Likelihood(worlds.trials(made))
    trial = likelihood.trials[0]
    form = WAVES.forms(worlds.trials(made)[0], Place.find(trial, "joint:lift"))[2]
    there = hypothesis(likelihood, WAVES, form, {"k": start, "v": TURN})
    assert there is not None
    evidence = Evidence(likelihood, 3.0)
    return evidence, evidence.refine(evidence.fit([there]), 0)


def stated(order: float, start: float, seed: int = 5) -> dict[str, ParameterEstimate]:
    evidence, fit = waving(order, start, seed)
    return estimates(evidence, fit, 0, np.random.default_rng(0))


def test_an_order_that_a_short_travel_leaves_open_has_a_wide_interval() -> None:
    """It was stated as 1.2 [1.0, 1.4] where it was 2, with the size that belongs to 1.2."""
    found = stated(1.8, 1.3)
    low, high = found["order"].ci95
    assert low < 1.8 < high and high / low > 1.5
    for name, true in (("amplitude", SIZE), ("level", LEVEL)):
        assert found[name].ci95[0] < true < found[name].ci95[1]


@pytest.mark.parametrize("seed", [2, pytest.param(6, marks=pytest.mark.thorough)])
def test_what_is_possible_is_followed_to_its_end(seed: int) -> None:
    """Where a step of twice the length was impossible, it ended early: 6 of 12 held the truth."""
    low, high = stated(1.8, 1.3, seed)["order"].ci95
    assert low < 1.8 < high


def test_an_order_that_the_travel_shows_is_pinned() -> None:
    found = stated(8.0, 8.0)
    low, high = found["order"].ci95
    assert low < 8.0 < high and high / low < 1.3
    assert found["amplitude"].ci95[0] < SIZE < found["amplitude"].ci95[1] < 1.5 * SIZE


def test_amplitudes_follow_shapes() -> None:
    """At another order other amplitudes are the most probable ones: half the way, about half of it."""
    evidence, fit = waving(1.8, 1.3)
    posterior = shape_posterior(evidence, fit, 0)
    (order,) = (p for p in posterior.profiles if p.name == "k")
    end = float(order.changes[-1])
    there = hypothesis(
        evidence.likelihood, WAVES, fit.hypotheses[0].form,
        {**fit.hypotheses[0].shape, "k": fit.hypotheses[0].shape["k"] * float(np.exp(end))},
    )  # fmt: skip
    assert there is not None
    anew = evidence.fit([there]).amplitudes[0]
    assert fit.amplitudes[0] + order.follow(end) == pytest.approx(anew)


def test_samples_along_a_gaussian_likelihood_have_its_width() -> None:
    width = 0.05
    changes = np.array([-0.16, -0.08, -0.04, -0.02, 0.0, 0.02, 0.04, 0.08, 0.16])
    rows = np.zeros((len(changes), 1))
    profile = Profile("k", changes, 0.5 * (changes / width) ** 2, rows, rows[:, :, None])
    rng = np.random.default_rng(0)
    drawn = [profile.sample(rng) for _ in range(4000)]
    assert np.std(drawn) == pytest.approx(width, rel=0.05)
    assert abs(np.mean(drawn)) < 0.003
