"""The benchmark runs, and the simulator is as fast as promised, as a ratio within one run."""

from __future__ import annotations

import pytest

from samrl_core.studies.speed.arm_dynamics import benchmark
from tests.diagnosis.simulation.arms import ARMS


@pytest.mark.slow
def test_a_nominal_rollout_beats_pinocchio_from_python() -> None:
    figures = benchmark(*ARMS["panda"], steps=1000)
    assert figures["pinocchio_python_ratio"] > 2.0
    assert figures["adjoint_32_us"] < 30 * figures["friction_us"]
