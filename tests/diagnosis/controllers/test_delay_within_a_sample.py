"""A servo that follows its goal a sample late, where the log holds goals and positions alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.kinds import POSITION_SERVO
from tests.diagnosis.controllers.machines import Differs, Machine, worlds

# Dead band and punch, as sold; a bus that asks for the position every 9 ms.
HOBBY = replace(POSITION_SERVO, rate=1.0 / 0.009, speed_log=0.0)
CORRELATED, NEEDED = 5.0, 12.0


def best_delay(machine: Machine, late: float) -> tuple[float, float]:
    """The delay [s] that the fitted recordings prefer, and its log evidence [nat]."""
    ((*fitted, _),) = worlds(machine, [Differs(delay=late)], 1, 4.0)
    evidence = Evidence(Likelihood([Trial(r, RigidArm(r.arm)) for r in fitted]), CORRELATED)
    fits = [evidence.fit([h]) for h in evidence.screen(library(["command_delay"]))]
    best = evidence.refine(max(fits, key=lambda f: f.log_evidence), 0)
    return best.hypotheses[0].shape["T"], best.log_evidence


def test_a_delay_of_one_sample_is_found() -> None:
    delay, evidence = best_delay(HOBBY, 0.009)
    assert delay == pytest.approx(0.009, abs=0.0006)
    assert evidence > NEEDED


def test_a_servo_that_is_not_late_has_no_delay() -> None:
    _, evidence = best_delay(HOBBY, 0.0)
    assert evidence < 0.0
