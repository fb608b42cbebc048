"""Forms of one effect that come near each other on the grid are all searched before one is taken."""

from __future__ import annotations

import pytest

from samrl_core.diagnosis.diagnose import library
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.search import best_singles
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.kinds import POSITION_SERVO
from tests.diagnosis.controllers.machines import Differs, worlds

CUTOFF_HZ = 5.8  # between the grid's 4 and 8, where a filter of second order does better


def test_a_filter_between_the_cut_offs_of_the_grid_is_of_its_own_order() -> None:
    ((*fitted, _),) = worlds(POSITION_SERVO, [Differs(cutoff=CUTOFF_HZ)], 1, 3.0)
    evidence = Evidence(Likelihood([Trial(r, RigidArm(r.arm)) for r in fitted]), 2.0)
    pool = evidence.screen(library(["command_low_pass"]))
    grid = max((evidence.fit([h]) for h in pool), key=lambda f: f.log_evidence)
    assert grid.hypotheses[0].form.name == "command second order"
    found = best_singles(evidence, pool)[0].hypotheses[0]
    assert found.form.name == "command"
    assert found.shape["fc"] == pytest.approx(CUTOFF_HZ, rel=0.02)
