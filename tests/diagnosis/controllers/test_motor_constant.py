"""Weak or strong magnets: torque and back-EMF are off by one factor, which no supply does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose, library
from samrl_core.diagnosis.effects.drive.motor_constant import EFFECT
from samrl_core.diagnosis.effects.form import Place
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.kinds import CURRENT_MOTOR, VOLTAGE_MOTOR, VOLTAGE_SERVO
from tests.diagnosis.controllers.machines import Differs, Machine, worlds

# Heavy enough that a torque's factor shows beside what its encoder's steps leave of accelerations.
CURRENT_LOGGED = replace(
    VOLTAGE_SERVO, about={**VOLTAGE_SERVO.about, "effort_from": "current"}, records="current", mass=0.9
)
CORRELATED = 10.0  # samples that count as one


def trials_of(machine: Machine, differs: Differs) -> list[Trial]:
    """All recordings but the last."""
    ((*fitted, _),) = worlds(machine, [differs], 1, 3.0)
    return [Trial(recording, RigidArm(recording.arm)) for recording in fitted]


def best(trials: list[Trial], family: str) -> Fit:
    """The best form of a family by itself."""
    evidence = Evidence(Likelihood(trials), CORRELATED)
    return max((evidence.fit([h]) for h in evidence.screen(library([family]))), key=lambda f: f.log_evidence)


@pytest.mark.parametrize(
    ("machine", "size"), [(VOLTAGE_MOTOR, -0.15), (VOLTAGE_SERVO, 0.15), (CURRENT_LOGGED, -0.15)]
)
def test_one_factor_of_both_constants_is_measured_and_is_no_gain(machine: Machine, size: float) -> None:
    trials = trials_of(machine, Differs(magnets=size))
    found, gain = (best(trials, family) for family in ("motor_constant", "actuator_gain"))
    (h,) = found.hypotheses
    assert h.form.parameters(trials[0], h.shape, found.amplitudes[0])["e"] == pytest.approx(size, rel=0.1)
    assert found.log_evidence > gain.log_evidence + 10.0


def test_a_motor_on_a_current_has_a_gain_of_its_torque_alone() -> None:
    """No back-EMF is described, and none would show."""
    (trial, *_) = trials_of(CURRENT_MOTOR, Differs(gain=0.1))
    assert EFFECT.forms(trial, Place("joint:swing", (0,))) == ()


@pytest.mark.slow
@pytest.mark.parametrize("size", [-0.1, 0.2])
def test_a_bench_with_other_magnets_is_named_with_their_size(size: float) -> None:
    """A supply of the other sign makes it as fast without load, and was named."""
    ((*fitted, held_out),) = worlds(VOLTAGE_MOTOR, [Differs(magnets=size)], 1)
    found, _ = diagnose(fitted, [held_out], DiagnosisSettings())
    assert [e.family for e in found.effects] == ["motor_constant"], (found.verdict, found.reasons)
    low, high = found.effects[0].parameters["e"].ci95
    assert low - 0.005 <= size <= high + 0.005
    assert found.gap is not None and found.gap.shrink is not None and found.gap.shrink > 0.5
