"""Dry frictions whose sign turns otherwise than the sharpest tanh: their size and their waves are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose, library
from samrl_core.diagnosis.effects.drive.torque_rate_limit import LimitedRate
from samrl_core.diagnosis.effects.drive_torque import usual_turns
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.effects.friction.position_dependent_friction import OVER_TRAVEL, WAVES
from samrl_core.diagnosis.residuals.basis_functions import half_speed, power_sign
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit, on_bound
from samrl_core.diagnosis.selection.onset_search import find_onset
from samrl_core.diagnosis.selection.search import best_singles
from tests.diagnosis import worlds
from tests.diagnosis.controllers.kinds import VOLTAGE_MOTOR
from tests.diagnosis.controllers.machines import Differs
from tests.diagnosis.controllers.machines import worlds as machines
from tests.diagnosis.test_diagnose import assert_covers
from tests.diagnosis.worlds import TURN

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]  # position [rad], velocity [rad/s] -> lost torque [N m]
PLACE = Place("joint:turn", (TURN,))
DRY = ("coulomb_friction", "presliding")


def losing(recording: ArmRecording, law: Law) -> ArmRecording:
    """The same motion by a drive that had to give more; what was tracked is not logged."""
    sent, states = recording.commanded_effort, recording.states
    assert sent is not None and sent.effort is not None
    assert states.position is not None and states.velocity is not None
    q, v = (np.interp(sent.time, states.time, x[:, TURN]) for x in (states.position, states.velocity))
    effort = sent.effort.copy()
    effort[:, TURN] += law(q, v)
    return replace(recording, command=None, commanded_effort=replace(sent, effort=effort))


def begun(recording: ArmRecording, law: Law, onset: float) -> ArmRecording:
    """The same, from a moment [s] on."""
    later = losing(recording, law)
    before, after = recording.commanded_effort, later.commanded_effort
    assert before is not None and before.effort is not None
    assert after is not None and after.effort is not None
    on = (after.time - after.time[0] >= onset)[:, None]
    return replace(later, commanded_effort=replace(after, effort=np.where(on, after.effort, before.effort)))


def best_of(family: str, law: Law) -> tuple[Fit, float]:
    """The best fit of a family at the joint, and the share of the evidence's excess that it leaves."""
    a, b, _ = worlds.world(1)
    likelihood = Likelihood(worlds.trials([losing(r, law) for r in (a, b)]))
    evidence = Evidence(likelihood, likelihood.correlation_time(likelihood.y) ** 0.5)
    (effect,) = library([family])
    pool = [h for h in evidence.screen([effect]) if h.place == PLACE.name]
    fit = best_singles(evidence, pool)[0]
    k = evidence.correlation_time
    left = likelihood.deficit(evidence.remainder(fit), k) / likelihood.deficit(likelihood.y, k)
    return fit, left


def test_a_friction_that_nears_its_level_slowly_keeps_its_size() -> None:
    """Tolerated frictions of several widths mended its shape, and took a fifth of its size for that."""
    fit, left = best_of("coulomb_friction", lambda q, v: 0.8 * 2.0 / np.pi * np.arctan(v / 0.005))
    assert fit.hypotheses[0].form.name == "slow to saturate"
    assert fit.amplitudes[0][0] == pytest.approx(0.8, rel=0.06)
    assert left < 0.02


def test_a_tanh_stays_a_tanh() -> None:
    fit, left = best_of("coulomb_friction", lambda q, v: 0.8 * np.tanh(v / 0.005))
    assert fit.hypotheses[0].form.name == "smooth"
    assert fit.amplitudes[0][0] == pytest.approx(0.8, rel=0.04)  # the background has up to 0.028 N m too
    assert left < 0.02


@pytest.mark.parametrize("exponent", [0.8, 1.0, 2.0, 4.0])
def test_a_power_sign_nears_one_as_it_says(exponent: float) -> None:
    v = np.array([-3.0, -0.01, 0.0, 0.01, 3.0])
    sign = power_sign(v, 0.01, exponent)
    assert sign == pytest.approx(-sign[::-1])
    assert 1.0 - sign[-1] == pytest.approx((0.01 / 3.0) ** exponent / exponent, rel=0.02)
    at = half_speed(0.01, exponent)
    assert power_sign(np.array([at]), 0.01, exponent) == pytest.approx(0.5)


@pytest.mark.thorough
def test_tight_spots_are_found_where_the_sign_turns_slowly() -> None:
    """With the sharpest sign their level comes out negative: the search of this form did not begin.

    Another order was named then, with a Coulomb friction beside it.
    """

    def volts(most: float, hertz: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda t: most * np.sin(2 * np.pi * hertz * t) + 0.2 * np.sin(2 * np.pi * (0.25 + hertz) * t)

    paths = {"A": volts(1.3, 0.11), "B": volts(1.0, 0.17), "C": volts(1.2, 0.13)}
    slow = replace(VOLTAGE_MOTOR, paths=paths)
    bump, order = 0.04, 6.5
    *fitted, held_out = machines(slow, [Differs(tight=(bump, order, 0.06))], 1, 8.0)[0]
    families = {"position_dependent_friction", "coulomb_friction", "load_dependent_friction"}
    diagnosis, _ = diagnose(fitted, [held_out], DiagnosisSettings(library=families))
    assert [e.name for e in diagnosis.effects] == ["position_dependent_friction@joint:swing"]
    found = diagnosis.effects[0].parameters
    assert_covers(found["order"], order, 0.03)
    assert_covers(found["amplitude"], 0.5 * bump, 0.05)
    assert_covers(found["level"], (0.15 + 3 / 8) * bump)


def test_orders_are_searched_without_a_gap_that_the_travel_tells_apart() -> None:
    trial = worlds.trials(worlds.world(1, "A"))[0]
    (effect,) = library(["position_dependent_friction"])
    (form,) = (f for f in effect.forms(trial, PLACE) if f.name == "friction everywhere")
    orders = np.unique([shape["k"] for shape in form.shapes])
    half = np.pi / float(trial.travel[TURN])
    beyond = orders[orders >= max(WAVES)]
    assert np.all(np.diff(beyond) < 1.2 * half)
    assert beyond[-1] == pytest.approx(2.0 * half * max(OVER_TRAVEL))


def test_a_slow_machine_is_searched_with_a_wide_turn_too() -> None:
    trial = worlds.trials(worlds.world(1, "A"))[0]
    trial.fastest = np.full(3, 1.0)
    assert usual_turns(trial, (0,)) == pytest.approx((0.005, 0.06))


@pytest.mark.parametrize("step", [0.0, 1.5e-3, 0.05])
def test_a_friction_that_builds_up_within_a_step_of_the_encoder_is_coulombs(step: float) -> None:
    """A servo of 4096 steps a turn had Coulomb friction; it was named presliding, over 0.4 of a step."""
    trial = worlds.trials(worlds.world(1, "A"))[0]
    trial.motion.reading_step = np.full(3, step)
    coulomb, presliding = (e.forms(trial, Place.find(trial, PLACE.name)) for e in library(DRY))
    (stiff,) = (f for f in coulomb if f.name == "stiff bristle")
    border = max(step, 1.5e-4)
    assert stiff.refine["xs"][1] == border
    assert bool(presliding) == (border < 0.02)
    for form in presliding:
        assert form.refine["xs"][0] == border
        assert all(border < shape["xs"] < form.refine["xs"][1] for shape in form.shapes)


def test_what_begins_is_searched_in_all_its_forms() -> None:
    """Of a friction that begins, the stiffest bristle fitted best as one that was there all along.

    With an onset it stayed on the bound of its search, and was refused for that.
    """
    onset, law = 3.1, lambda q, v: 0.8 * np.tanh(v / 0.008)
    a, b, _ = worlds.world(1)
    likelihood = Likelihood(worlds.trials([begun(r, law, onset) for r in (a, b)]))
    evidence = Evidence(likelihood, likelihood.correlation_time(likelihood.y) ** 0.5)
    pool = [h for h in evidence.screen(library(["coulomb_friction"])) if h.place == PLACE.name]
    stiff = max((evidence.fit([h]) for h in pool if "xs" in h.shape), key=lambda f: f.log_evidence)
    (found,) = find_onset(evidence, pool, [stiff], stiff.log_evidence)
    first = found.hypotheses[0]
    assert "xs" not in first.shape and not on_bound(first)
    assert first.shape[ONSET] == pytest.approx(onset, abs=0.1)
    assert found.amplitudes[0][0] == pytest.approx(0.8, rel=0.06)


def test_coulomb_friction_that_begins_goes_before_a_drop_that_mends_its_sign() -> None:
    """A sealed world's was Stribeck friction without a drop, on the bound of its search, and was refused."""
    onset, law = 3.1, lambda q, v: 0.8 * np.tanh(v / 0.008)
    a, b, _ = worlds.world(1)
    likelihood = Likelihood(worlds.trials([begun(r, law, onset) for r in (a, b)]))
    evidence = Evidence(likelihood, likelihood.correlation_time(likelihood.y) ** 0.5)
    families = library(["coulomb_friction", "stribeck_friction"])
    pool = [h for h in evidence.screen(families) if h.place == PLACE.name]
    falling = max(
        (evidence.fit([h]) for h in pool if h.effect.family == "stribeck_friction"),
        key=lambda f: f.log_evidence,
    )
    tried = find_onset(evidence, pool, [falling], falling.log_evidence)
    assert [f.hypotheses[0].effect.family for f in tried] == ["coulomb_friction", "stribeck_friction"]
    assert tried[0].hypotheses[0].shape[ONSET] == pytest.approx(onset, abs=0.1)


def test_a_rate_limit_that_takes_nearly_all_torque_is_none() -> None:
    """A drive that has nothing to do but its friction seemed to give nothing: 0.05 N m/s."""
    trial = worlds.trials(worlds.world(1, "B"))[0]
    (effect,) = library(["torque_rate_limit"])
    (form,) = effect.forms(trial, PLACE)
    assert isinstance(form, LimitedRate)
    assert not form.is_possible(trial, {"R": 0.05})
    assert form.is_possible(trial, {"R": 60.0})
