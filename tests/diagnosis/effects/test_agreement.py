"""Regressors and simulator are two implementations of one formula: they must agree on size and on sign."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest

from samrl_core.diagnosis.effects import EFFECTS, Effect
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Hypothesis, hypothesis
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.verdict.confidence import estimates
from tests.diagnosis import worlds
from tests.diagnosis.cases import CASES, Case, find_form

BY_FAMILY = {e.family: e for e in EFFECTS}
_RATE = "the simulator's velocity reading lacks the rate of the hysteresis that its position reading has"
FORMULA_DEFECTS = {"transmission_hysteresis": _RATE}
FIT_DEFECTS = {
    **FORMULA_DEFECTS,
    "coulomb_friction-stiff_bristle": "the tolerances' smooth signs take a quarter of the level",
}


def known(cases: Iterable[Case], defects: Mapping[str, str], needs_physical: bool = False) -> list[Any]:
    """Cases as pytest parameters, those with a known defect expected to fail."""
    return [
        pytest.param(c, id=c.name, marks=[_xfail(defects[c.name])] if c.name in defects else [])
        for c in cases
        if c.physical or not needs_physical
    ]


def _xfail(reason: str) -> pytest.MarkDecorator:
    return pytest.mark.xfail(strict=True, raises=AssertionError, reason=reason)


@cache
def likelihood_of(name: str) -> Likelihood:
    """With sensor noise, but no other difference."""
    (case,) = (c for c in CASES if c.name == name)
    real, rng = worlds.plant(**case.fields), np.random.default_rng(3)
    return Likelihood(worlds.trials(worlds.record(real, case.programmes, rng)))


def effect_of(case: Case) -> Effect:
    return BY_FAMILY[case.family]


def true_hypothesis(case: Case) -> Hypothesis:
    likelihood, effect = likelihood_of(case.name), effect_of(case)
    form = find_form(effect, likelihood.trials[0], case.place, case.form)
    shape = {name: case.shape.get(name, value) for name, value in form.shapes[0].items()}
    h = hypothesis(likelihood, effect, form, shape)
    assert h is not None, "nothing of it is seen"
    return h


@pytest.mark.parametrize("case", known(CASES, FORMULA_DEFECTS))
def test_true_amplitudes_explain_the_simulation(case: Case) -> None:
    likelihood, h = likelihood_of(case.name), true_hypothesis(case)
    prediction = likelihood.prediction(h.regressors, np.array(case.amplitudes))
    acts = np.zeros(len(likelihood.y), dtype=bool)  # where it does: other stages hold noise and background
    for block in h.regressors.blocks:
        acts[likelihood.blocks[block]] = True
    y, prediction = likelihood.y[acts], prediction[acts]
    size = float(prediction @ y / (prediction @ prediction))
    left = float(np.sum((y - prediction) ** 2) / np.sum(y**2))
    assert size == pytest.approx(1.0, abs=case.within), f"regressors see {size:.3f} times the simulated size"
    assert 1.0 - left > case.explained, f"{left:.1%} of the residual is another function of time"


@pytest.mark.parametrize("case", known(CASES, FIT_DEFECTS, needs_physical=True))
def test_a_fit_returns_the_simulated_parameters(case: Case) -> None:
    """Within a share of the value, or within the interval that is stated for it."""
    likelihood, h = likelihood_of(case.name), true_hypothesis(case)
    evidence = Evidence(likelihood)
    fit = evidence.fit([h])
    assert np.isfinite(fit.log_evidence)
    found = estimates(evidence, fit, 0, np.random.default_rng(0))
    for name, value in case.physical.items():
        estimate = found[name]
        low, high = estimate.ci95
        if name in ("phase", "phi"):
            apart = np.angle(np.exp(1j * (estimate.value - value)))
            assert abs(apart) < 0.15, f"{name}: {estimate.value:.3f} for {value:.3f} rad"
        elif not low <= value <= high:
            assert estimate.value == pytest.approx(value, rel=case.within), f"{name}: {estimate}"


@pytest.mark.parametrize("case", known(CASES, {}))
def test_the_plant_of_true_amplitudes_is_the_true_plant(case: Case) -> None:
    """What a fit would be re-simulated with moves as the world does that it was fitted to."""
    h = true_hypothesis(case)
    trial = likelihood_of(case.name).trials[0]
    values = h.form.plant_fields(trial, h.shape, np.array(case.amplitudes))
    if values is None:
        pytest.skip("compared along the log only")
    plants = PlantParameters(), worlds.plant(**case.fields), worlds.plant(**values)
    programme = case.programmes[-1]
    nominal, real, made = (worlds.rollout(p, programme, 3.0) for p in plants)
    for name in ("effort", "commanded_effort", "position"):
        does = getattr(real, name) - getattr(nominal, name)
        wrong = getattr(made, name) - getattr(real, name)
        if np.std(does) > 1e-4:
            assert np.sqrt(np.mean(wrong**2)) < 0.15 * np.sqrt(np.mean(does**2)), name
