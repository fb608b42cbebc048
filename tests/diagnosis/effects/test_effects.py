"""What every effect of the library must be: documented, linear in its amplitudes, seen, and searchable."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import samrl_core.diagnosis.effects
from samrl_core.cell.excitation.catalogue import KINDS
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.effects import EFFECTS, EVERY_EFFECT, FAMILIES, NOT_BY_JOINTS, Effect
from samrl_core.diagnosis.findings.curves import AXES
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import as_arms
from samrl_core.diagnosis.selection.hypothesis import Evidence, hypothesis
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis import worlds
from tests.diagnosis.cases import CASES, Case, find_form
from tests.diagnosis.effects.test_agreement import likelihood_of, true_hypothesis

EACH = pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.family)
# A shape for which the response is that of a nominal drive.
NEUTRAL_SHAPES = {
    ("command_delay", "command"): {"T": 1e-12},
    ("command_delay", "effort"): {"T": 1e-12},
    ("command_low_pass", "command"): {"fc": 1e9},
    ("command_low_pass", "effort"): {"fc": 1e9},
    ("dead_band", ""): {"width": 1e-15},
    ("torque_saturation", "drive"): {"L": 1e6},
    ("torque_saturation", "soft"): {"L": 1e6, "p": 14.0},
    ("torque_saturation", "controller"): {"L": 1e6},
    ("torque_rate_limit", ""): {"R": 1e9},
}
STIFF_SHAPES = {
    ("joint_elasticity", "swinging"): {"K": 1e9, "d": 0.0},
    ("backlash", "free"): {"K": 1e9, "d": 0.0, "b": 0.0},
}


@cache
def rich() -> Likelihood:
    """All channels, all joints in motion, and now and then a lost packet, so that everything can be seen."""
    return Likelihood(worlds.trials(worlds.world(11, "D", hold_probability=0.2)))


def test_families_and_numbers_are_unique() -> None:
    assert len({e.family for e in EFFECTS}) == len(EFFECTS)
    files = [
        f
        for f in Path(samrl_core.diagnosis.effects.__file__).parent.glob("*/*.py")
        if "\nEFFECT = " in f.read_text()
    ]
    assert len(files) == len(EVERY_EFFECT), "a file of an effect is not listed"
    assert len({e.number for e in EFFECTS}) == len(EFFECTS)
    assert not {e.family for e in EFFECTS} & set(NOT_BY_JOINTS)


@EACH
def test_effects_are_documented(effect: Effect) -> None:
    assert effect.family.isidentifier() and effect.family == effect.family.lower()
    assert 1 <= effect.number <= len(FAMILIES)
    for text in (effect.title, effect.formula, effect.source, effect.excitation):
        assert len(text) > 3
    assert effect.acts_on in ("command", "dynamics", "reading")
    assert effect.place_kind in ("joint", "link", "arm")
    known = {e.family for e in EFFECTS} | set(NOT_BY_JOINTS)
    assert effect.confounded_with and set(effect.confounded_with) <= known - {effect.family}


@EACH
def test_parameters_have_units_and_ranges(effect: Effect) -> None:
    assert effect.parameters
    assert len({p.name for p in effect.parameters}) == len(effect.parameters)
    for p in effect.parameters:
        assert p.unit and p.meaning
        assert np.isfinite([p.low, p.high]).all() and p.low < p.high


@EACH
def test_reported_parameters_are_documented_ones(effect: Effect) -> None:
    trial = rich().trials[0]
    documented = {p.name for p in effect.parameters}
    for place in effect.places(trial)[:1]:
        for form in effect.forms(trial, place):
            amplitudes = np.full(len(form.prior(trial, form.shapes[0])[0]), 0.1)
            found = form.parameters(trial, form.shapes[0], amplitudes)
            assert found and set(found) <= documented, form.name
            assert np.isfinite(list(found.values())).all()


@EACH
def test_columns_are_finite_and_seen(effect: Effect) -> None:
    likelihood = rich()
    (trial, *_) = as_arms(likelihood.trials)
    assert effect.why_unobservable(trial) is None
    for place in effect.places(trial):
        kind = place.name.partition(":")[0]
        assert kind == effect.place_kind or kind == "arm"
        for form in effect.forms(trial, place):
            shape = form.shapes[0]
            columns = form.columns(trial, shape)
            for (channel, joint), rows in columns.items():
                assert channel in trial.channels and 0 <= joint < trial.joints
                assert rows.shape[1] == len(trial) and np.isfinite(rows).all()
            mean, spread = form.prior(trial, shape)
            assert {len(rows) for rows in columns.values()} <= {len(mean)}
            assert mean.shape == spread.shape
            assert len(mean) == len(form.amplitudes) or kind == "arm"  # at the arm, one for each joint
            assert (spread > 0).all()
    seen = Evidence(likelihood).screen([effect])
    assert seen, "no place, form or shape of it is seen in any channel"


@EACH
def test_amplitude_zero_changes_nothing(effect: Effect) -> None:
    likelihood = rich()
    for h in Evidence(likelihood).screen([effect]):
        assert np.array_equal(likelihood.minus(h.regressors, np.zeros(len(h.mean))), likelihood.y)
        assert not likelihood.prediction(h.regressors, np.zeros(len(h.mean))).any()


@pytest.mark.parametrize("family, form", NEUTRAL_SHAPES, ids=lambda x: str(x))
def test_neutral_shapes_of_fixed_responses_change_nothing(family: str, form: str) -> None:
    (trial, *_) = as_arms(rich().trials)
    (effect,) = library([family])
    columns = find_form(effect, trial, "joint:lift", form).columns(trial, NEUTRAL_SHAPES[family, form])
    scale = float(np.std(trial.motion.u)) if trial.motion.u is not None else 1.0
    assert columns
    for rows in columns.values():
        assert np.max(np.abs(rows)) < 1e-6 * scale


@EACH
def test_neutral_amplitudes_make_a_neutral_plant(effect: Effect) -> None:
    """What is left of a plant whose effect is (nearly) nothing moves as the nominal one does."""
    trial = rich().trials[0]
    neutral, names = PlantParameters(), {f.name for f in fields(PlantParameters)}
    made = 0
    for place in effect.places(trial)[:2]:
        for form in effect.forms(trial, place):
            mean, _ = form.prior(trial, form.shapes[0])
            fixed = np.any(mean)
            key = effect.family, form.name
            shape = dict(form.shapes[0])
            if fixed:
                shape |= (NEUTRAL_SHAPES | STIFF_SHAPES).get(key, {})
            amplitudes = np.where(mean, 1.0, 1e-9)
            values = form.plant_fields(trial, shape, amplitudes)
            if values is None:
                continue
            made += 1
            assert values and set(values) <= names
            real = worlds.plant(**values)
            if fixed:
                assert all(_is_neutral(name, value, neutral) for name, value in values.items()), values
            else:
                run, nominal = (worlds.rollout(p, "B", 0.4) for p in (real, neutral))
                for name in ("position", "velocity", "effort", "commanded_effort"):
                    apart = np.max(np.abs(getattr(run, name) - getattr(nominal, name)))
                    assert apart < 1e-3, f"{form.name}: {name} differs by {apart:.2g}"
    assert bool(made) == effect.simulated


def _is_neutral(name: str, value: object, neutral: PlantParameters) -> bool:
    got, want = np.asarray(value, float), float(getattr(neutral, name))
    return bool(np.all(got > 1e5)) if np.isinf(want) else bool(np.allclose(got, want, atol=1e-6))


REFINED = [c for c in CASES if c.shape and c.family not in ("mount_compliance",)]


# The simulator's velocity reading lacks the rate of the hysteresis, so the fit of it is no physical one.
LED = [c for c in REFINED if c.family != "transmission_hysteresis"]


@pytest.mark.parametrize("case", LED, ids=lambda c: c.name)
def test_evidence_leads_every_refined_shape(case: Case) -> None:
    """Central differences, off the truth: a shape without gradient would stay where its search began."""
    likelihood, truth = likelihood_of(case.name), true_hypothesis(case)
    evidence, form = Evidence(likelihood), truth.form
    refined = [name for name in form.refine if name in truth.shape]
    assert refined, "a shape that is listed but never searched"
    for name in refined:
        step = 0.1 * form.step

        def at(offset: float, name: str = name) -> float:
            shape = {**truth.shape, name: truth.shape[name] * float(np.exp(offset))}
            h = hypothesis(likelihood, truth.effect, form, shape)
            return -np.inf if h is None else evidence.fit([h]).log_evidence

        slopes = [(at(s * form.step + step) - at(s * form.step - step)) / (2 * step) for s in (-1, 1)]
        finite = [s for s in slopes if np.isfinite(s)]
        assert finite and max(abs(s) for s in finite) > 0.5, f"{name}: {slopes} nat per unit of its logarithm"
        low, high = form.refine[name]
        assert low < truth.shape[name] < high


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.family)
def test_searches_begin_off_their_bounds(effect: Effect) -> None:
    trial = rich().trials[0]
    for place in effect.places(trial):
        for form in effect.forms(trial, place):
            for name, (low, high) in form.refine.items():
                assert 0 < low < high
                for shape in form.shapes:
                    if name in shape:
                        part = np.log(shape[name] / low) / np.log(high / low)
                        assert 0.02 < part < 0.98, f"{place.name} {form.name}: {name} starts at {shape[name]}"


def test_libraries_are_checked() -> None:
    assert [e.family for e in library(["payload"])] == ["payload"]
    assert library(None) == EFFECTS
    with pytest.raises(InputError, match="unknown families"):
        library(["coulomb_frction"])
    with pytest.raises(InputError, match="no effect"):
        library(["kinematic_error"])
    with pytest.raises(InputError):
        library([])


def test_every_file_of_a_room_is_in_the_library() -> None:
    """An effect's file without its line in the registry would never be tried."""
    folder = Path(samrl_core.diagnosis.effects.__file__).parent
    written = {p.stem for p in folder.glob("*/*.py") if "\nEFFECT = " in p.read_text()}
    assert written == {e.family for e in EVERY_EFFECT}
    assert [e.number for e in EFFECTS] == sorted(e.number for e in EFFECTS)


def test_words_for_the_report_are_whole_sentences() -> None:
    assert {"velocity", "position", "acceleration"} == set(AXES)
    for effect in EFFECTS:
        assert effect.title[0].isupper() and effect.meaning.endswith(".") and effect.remedy.endswith(".")
        assert effect.curve_over in (*AXES, "effort") and effect.experiment in KINDS
        shapes = {p.name for p in effect.parameters} | set(effect.renamed_shapes)
        trial = rich().trials[0]
        found = {n for place in effect.places(trial) for f in effect.forms(trial, place) for n in f.refine}
        assert set(effect.renamed_shapes) <= found, "a shape that no form searches"
        assert shapes
    assert [e.running_title for e in library(["coulomb_friction", "cable"])] == [
        "Coulomb friction",
        "cable or hose",
    ]
