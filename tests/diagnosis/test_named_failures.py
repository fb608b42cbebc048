"""Failures that are known and must not happen here: each a wrong name, or a name too many."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose, library
from samrl_core.diagnosis.effects import EFFECTS
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis, on_bound
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds
from tests.diagnosis.cases import PAYLOAD, shifted_fore
from tests.diagnosis.test_diagnose import LOADS, assert_covers, diagnosed
from tests.diagnosis.worlds import BEND, LIFT, TURN

EVERYTHING = {e.family for e in EFFECTS}
NO_SPRINGS = EVERYTHING - {"joint_elasticity", "backlash", "transmission_hysteresis"}
GAINS_AND_LIKE = {
    "controller_gain", "actuator_gain", "reflected_inertia", "command_delay", "command_low_pass",
}  # fmt: skip
BRISTLE: dict[str, Any] = {"coulomb": {LIFT: 0.8}, "presliding_stiffness": {LIFT: 400.0}}
SPRING: dict[str, Any] = {"joint_stiffness": {LIFT: 1500.0}, "joint_damping": {LIFT: 3.0}}
SWINGING: dict[str, Any] = {"mount_stiffness": 8000.0, "mount_damping": 40.0, "mount_inertia": 15.0}
# a mass on the first joint's vertical axis: it turns with no inertia and lifts nothing
UNSEEN_MASS = np.zeros((3, 10))
UNSEEN_MASS[0, [0, 3]] = 1.5, 0.12


# -- elasticity must not come back as delay ----------------------------------------------------------------


@pytest.mark.slow
def test_elasticity_that_is_not_in_the_library_is_no_delay() -> None:
    diagnosis = diagnosed(
        6,
        {"command_delay", "command_low_pass", "viscous_friction", "payload", "reflected_inertia"},
        **SPRING,
    )
    assert diagnosis.verdict == "none_of_mine", diagnosis.reasons
    assert not diagnosis.effects and diagnosis.signatures


@pytest.mark.slow
@pytest.mark.parametrize(
    "fields",
    [
        SPRING,
        {"joint_stiffness": 2500.0, "joint_damping": 3.0},
        {"joint_stiffness": {BEND: 600.0}, "joint_damping": {BEND: 1.0}},
    ],
    ids=["one joint", "all joints", "last joint"],
)
def test_elasticity_that_is_withheld_is_refused(fields: dict[str, Any]) -> None:
    diagnosis = diagnosed(6, NO_SPRINGS, **fields)
    assert diagnosis.verdict == "none_of_mine", (diagnosis.reasons, diagnosis.effects)
    assert diagnosis.nearest is None or diagnosis.nearest.family != "command_delay"


@pytest.mark.slow
def test_elasticity_in_the_library_is_named() -> None:
    diagnosis = diagnosed(5, **SPRING)
    assert diagnosis.verdict == "effect", diagnosis.reasons
    (effect,) = diagnosis.effects
    assert effect.name == "joint_elasticity@joint:lift"
    assert effect.parameters["K"].value == pytest.approx(1500.0, rel=0.1)


# -- a compliant stand -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "library",
    [LOADS | {"encoder_offset"}, pytest.param(EVERYTHING - {"mount_compliance"}, marks=pytest.mark.slow)],
    ids=["loads", "all others"],
)
def test_a_compliant_stand_that_is_withheld_is_refused(library: set[str]) -> None:
    diagnosis = diagnosed(5, library, **SWINGING)
    assert diagnosis.verdict == "none_of_mine", (diagnosis.reasons, diagnosis.effects)
    assert not diagnosis.effects and diagnosis.signatures
    assert diagnosis.unexplained_fraction > 0.25


@pytest.mark.slow
def test_a_compliant_stand_is_named() -> None:
    diagnosis = diagnosed(6, **SWINGING)
    assert diagnosis.verdict == "effect", diagnosis.reasons
    assert diagnosis.effects[0].name == "mount_compliance@arm:tool_arm"
    assert diagnosis.effects[0].parameters["compliance"].value == pytest.approx(1 / 8000.0, rel=0.2)


# -- Stribeck with only Coulomb and viscous --------------------------------------------------------------


@pytest.mark.parametrize("drop", [1.2, pytest.param(0.6, marks=pytest.mark.slow)])
def test_stribeck_is_not_explained_by_coulomb_and_viscous(drop: float) -> None:
    fields: dict[str, Any] = {
        "coulomb": {TURN: 0.3},
        "stribeck_drop": {TURN: drop},
        "stribeck_velocity": {TURN: 0.08},
    }
    diagnosis = diagnosed(5, {"coulomb_friction", "viscous_friction"}, **fields)
    assert diagnosis.verdict == "none_of_mine", (diagnosis.reasons, diagnosis.effects)


@pytest.mark.slow
def test_stribeck_in_the_library_is_named() -> None:
    fields: dict[str, Any] = {
        "coulomb": {TURN: 0.3},
        "stribeck_drop": {TURN: 1.2},
        "stribeck_velocity": {TURN: 0.08},
    }
    diagnosis = diagnosed(5, **fields)
    assert diagnosis.verdict == "effect", diagnosis.reasons
    assert diagnosis.effects[0].name == "stribeck_friction@joint:turn"
    assert diagnosis.effects[0].parameters["drop"].value == pytest.approx(1.2, rel=0.15)


# -- inertial null space ---------------------------------------------------------------------------------


def test_a_mass_that_no_motion_shows_is_not_claimed() -> None:
    diagnosis = diagnosed(5, {"link_inertia", "payload", "base_tilt"}, inertial_delta=UNSEEN_MASS)
    assert diagnosis.verdict == "no_gap", (diagnosis.reasons, diagnosis.effects)


def test_a_last_links_centre_of_mass_is_no_payload_of_no_mass() -> None:
    """Of two Qubes whose pendulum's centre lay elsewhere a payload of -0.000 kg was named."""
    delta = np.stack([np.zeros(10), np.zeros(10), shifted_fore()])
    diagnosis = diagnosed(5, {"link_inertia", "payload", "actuator_gain", "base_tilt"}, inertial_delta=delta)
    assert diagnosis.verdict == "effect", (diagnosis.reasons, diagnosis.effects)
    assert diagnosis.effects[0].name == "link_inertia@link:fore"
    assert diagnosis.effects[0].parameters["com_shift"].value == pytest.approx(0.017, rel=0.2)


def test_what_no_motion_shows_stays_at_its_prior() -> None:
    """The fit is regular although most of a first link's ten parameters have no column."""
    likelihood = Likelihood(worlds.trials(worlds.world(5, "AB", inertial_delta=UNSEEN_MASS)))
    (effect,) = library(["link_inertia"])
    trial = likelihood.trials[0]
    form, *_ = effect.forms(trial, Place.find(trial, "link:post"))
    h = hypothesis(likelihood, effect, form, {})
    assert h is not None
    columns = form.columns(trial, {})
    for rows in columns.values():
        assert np.max(np.abs(rows[0])) < 1e-9, "the mass of a link on a vertical axis loads no joint"
    fit = Evidence(likelihood).fit([h])
    deviation = np.sqrt(np.diag(fit.covariance))
    assert np.isfinite(fit.log_evidence) and np.isfinite(deviation).all()
    unseen = [k for k in range(10) if all(np.max(np.abs(rows[k])) < 1e-9 for rows in columns.values())]
    assert 0 in unseen and len(unseen) >= 5
    assert deviation[unseen] == pytest.approx(h.spread[unseen], rel=1e-6)
    assert fit.amplitudes[0][unseen] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_a_mass_that_no_motion_shows_does_not_hide_a_payload() -> None:
    diagnosis = diagnosed(5, inertial_delta=UNSEEN_MASS, payload=PAYLOAD)
    assert [e.name for e in diagnosis.effects] == ["payload@arm:tool_arm"], diagnosis.reasons
    assert_covers(diagnosis.effects[0].parameters["mass"], PAYLOAD[0])


# -- bounds ----------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_shape_that_ends_on_its_bound_is_an_alarm() -> None:
    (a,) = worlds.world(6, "A", command_delay=0.15)
    diagnosis, _ = diagnose([a], [], DiagnosisSettings(library={"command_delay"}))
    assert any("ended on the bound" in alarm for alarm in diagnosis.alarms), diagnosis.alarms
    assert diagnosis.verdict != "effect"


@pytest.mark.parametrize(
    "family, place, fields, name, truth",
    [
        ("command_delay", "joint:lift", {"command_delay": {LIFT: 0.0065}}, "T", 0.0065),
        ("command_low_pass", "joint:lift", {"command_cutoff": {LIFT: 12.0}}, "fc", 12.0),
        ("presliding", "joint:lift", BRISTLE, "xs", 0.002),
    ],
    ids=["delay", "low-pass", "presliding"],
)  # fmt: skip
def test_a_search_from_a_bound_is_never_quietly_wrong(
    family: str, place: str, fields: dict[str, Any], name: str, truth: float
) -> None:
    """From the grid a search finds the truth; from a bound it does so too, or says that it is stuck there."""
    likelihood = Likelihood(worlds.trials(worlds.world(5, "A", **fields)))
    (effect,) = library([family])
    trial = likelihood.trials[0]
    form = effect.forms(trial, Place.find(trial, place))[0]
    evidence = Evidence(likelihood)

    def searched(start: float) -> Fit:
        h = hypothesis(likelihood, effect, form, {name: start})
        assert h is not None
        first = evidence.fit([h])
        found = evidence.refine(first, 0, 80)
        assert found.log_evidence >= first.log_evidence
        return found

    best = max((searched(shape[name]) for shape in form.shapes), key=lambda fit: fit.log_evidence)
    assert best.hypotheses[0].shape[name] == pytest.approx(truth, rel=0.05)
    for bound in form.refine[name]:
        found = searched(bound)
        if on_bound(found.hypotheses[0]):
            assert found.log_evidence < best.log_evidence - 10.0
        else:
            assert found.hypotheses[0].shape[name] == pytest.approx(truth, rel=0.05)


# -- gains that are not as described ---------------------------------------------------------------------


@pytest.mark.parametrize(
    "place, seed", [("joint:lift", 5), pytest.param("arm:tool_arm", 6, marks=pytest.mark.slow)]
)
def test_changed_gains_are_named(place: str, seed: int) -> None:
    k, d = (0.75, 0.8) if place == "arm:tool_arm" else ({LIFT: 0.75}, {LIFT: 0.8})
    diagnosis = diagnosed(seed, GAINS_AND_LIKE, stiffness_scale=k, damping_scale=d)
    assert diagnosis.verdict == "effect", diagnosis.reasons
    (effect,) = diagnosis.effects
    assert effect.name == f"controller_gain@{place}"
    assert effect.parameters["eK"].value == pytest.approx(-0.25, abs=0.01)
    assert effect.parameters["eD"].value == pytest.approx(-0.2, abs=0.01)
    assert diagnosis.gap is not None and diagnosis.gap.shrink is not None and diagnosis.gap.shrink > 0.4


@pytest.mark.parametrize(
    "library",
    [
        GAINS_AND_LIKE - {"controller_gain"},
        pytest.param(EVERYTHING - {"controller_gain"}, marks=pytest.mark.slow),
    ],
    ids=["alike", "all others"],
)  # fmt: skip
def test_changed_gains_that_are_withheld_are_refused(library: set[str]) -> None:
    diagnosis = diagnosed(5, library, stiffness_scale={LIFT: 0.75}, damping_scale={LIFT: 0.8})
    assert diagnosis.verdict == "none_of_mine", (diagnosis.reasons, diagnosis.effects)


def test_drag_by_the_square_of_speed_is_no_viscous_friction() -> None:
    """A line fits it together with a dry friction that would be negative: tolerances must not lend that."""
    recordings = []
    for recording in worlds.world(21):
        states, sent = recording.states, recording.commanded_effort
        assert states.velocity is not None and states.effort is not None
        assert sent is not None and sent.effort is not None
        more = sent.effort.copy()
        speed = Trial(recording, RigidArm(recording.arm)).motion.full_velocity[:, worlds.TURN]
        more[:, worlds.TURN] += 1.5 * speed * np.abs(speed)
        recordings.append(replace(recording, commanded_effort=JointSignal(sent.time, effort=more)))
    a, b, c = recordings
    diagnosis, _ = diagnose([a, b], [c], DiagnosisSettings(library={"viscous_friction", "coulomb_friction"}))
    assert diagnosis.verdict == "none_of_mine", diagnosis.reasons
