"""Regressors and simulator are two implementations of one formula: they must agree on size and on sign."""

from __future__ import annotations

from dataclasses import fields
from functools import cache

import numpy as np
import pytest

from samrl_core.diagnosis.effects import EFFECTS, Effect
from samrl_core.diagnosis.hypothesis import Evidence, Hypothesis, hypothesis
from samrl_core.diagnosis.likelihood import Likelihood
from samrl_core.dynamics.plant_parameters import PlantParameters
from tests.diagnosis import worlds
from tests.diagnosis.cases import CASES, Case

BY_FAMILY = {e.family: e for e in EFFECTS}
ALL = pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)


@cache
def likelihood_of(name: str) -> Likelihood:
    """Free of noise and background: what is left is the effect, and what sampling does."""
    (case,) = (c for c in CASES if c.name == name)
    return Likelihood(worlds.trials(worlds.record(worlds.plant(**case.fields), case.programmes)))


def effect_of(case: Case) -> Effect:
    return BY_FAMILY[case.family]


def true_hypothesis(case: Case) -> Hypothesis:
    likelihood, effect = likelihood_of(case.name), effect_of(case)
    (form,) = (f for f in effect.forms(likelihood.trials[0], case.place) if f.name == case.form)
    h = hypothesis(likelihood, effect, case.place, form, case.shape)
    assert h is not None, "nothing of it is seen"
    return h


@ALL
def test_true_amplitudes_explain_the_simulation(case: Case) -> None:
    likelihood, h = likelihood_of(case.name), true_hypothesis(case)
    prediction = likelihood.prediction(h.regressors, np.array(case.amplitudes))
    y = likelihood.y
    size = float(prediction @ y / (prediction @ prediction))
    left = float(np.sum((y - prediction) ** 2) / np.sum(y**2))
    assert size == pytest.approx(1.0, abs=0.15), f"regressors see {size:.3f} times the simulated size"
    assert 1.0 - left > case.explained, f"{left:.1%} of the residual is another function of time"


@pytest.mark.parametrize("case", [c for c in CASES if c.physical], ids=lambda c: c.name)
def test_a_fit_returns_the_simulated_parameters(case: Case) -> None:
    likelihood, h = likelihood_of(case.name), true_hypothesis(case)
    fit = Evidence(likelihood).fit([h])
    assert np.isfinite(fit.log_evidence)
    found = effect_of(case).physical(likelihood.trials[0], case.place, case.form, case.shape, fit.amplitudes[0])
    for name, value in case.physical.items():
        if name in ("phase", "phi"):
            apart = np.angle(np.exp(1j * (found[name] - value)))
            assert abs(apart) < 0.15, f"{name}: {found[name]:.3f} for {value:.3f} rad"
        else:
            assert found[name] == pytest.approx(value, rel=0.15), name
