"""A torque sensor behind the gears, and a law that says what the motors were asked for: nobody logged it."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers.servos import PositionServo
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis.controllers.test_passive_joint import TWO

JOINTS, PERIOD_S, SECONDS = ("pivot", "elbow"), 0.005, 8.0
LAW = {"stiffness": [60.0, 1.0], "damping": [3.0, 0.03], "effort_limit": [20.0, 10.0]}
LIBRARY = DiagnosisSettings(
    library={"coulomb_friction", "viscous_friction", "payload", "torque_sensor_error"}
)


def recording(coulomb: float, seed: int) -> ArmRecording:
    """Positions, velocities and what the sensors read, under goals that both joints follow."""
    law = PositionServo().read({"joints": list(JOINTS), "period_s": PERIOD_S, **LAW}, JOINTS, "mapping")
    arm = ArmDescription("tool_arm", JOINTS, TWO, law)
    time = np.arange(0.0, SECONDS, PERIOD_S)
    goal = np.stack([0.7 * np.sin((1.5 + seed) * time), 0.5 * np.sin((2.3 + seed) * time + 1.0)], axis=1)
    goal *= (1.0 - np.exp(-(time**3)))[:, None]
    command = JointSignal(time, goal, np.gradient(goal, PERIOD_S, axis=0), None, np.zeros_like(goal))
    plant = PlantParameters(coulomb=np.array([coulomb, 0.0]))
    run = ClosedLoop(LoopModel(arm)).rollout(command, goal[0], np.zeros(2), [plant], SECONDS)
    rng = np.random.default_rng(seed)
    read = [x[0] + level * rng.standard_normal(x[0].shape)
            for x, level in ((run.position, 1e-5), (run.velocity, 1e-3), (run.effort, 0.005))]  # fmt: skip
    states = JointSignal(run.time, read[0], read[1], None, read[2])
    return ArmRecording(f"run {seed}", f"run{seed}", "", arm, states, command, None)


@pytest.mark.parametrize("coulomb", [0.0, 0.3])
def test_friction_between_the_law_and_the_sensor_is_told(coulomb: float) -> None:
    """A seven-axis arm's dry friction passed: "not testable" with 20 more, though its law was stated."""
    found = diagnose([recording(coulomb, 0)], [recording(coulomb, 1)], LIBRARY)[0]
    assert not found.not_testable.keys() & {"coulomb_friction", "viscous_friction"}
    if not coulomb:
        assert found.verdict == "no_gap", found.reasons
        return
    assert [e.name for e in found.effects] == ["coulomb_friction@joint:pivot"], found.reasons
    assert found.effects[0].parameters["Fc"].value == pytest.approx(coulomb, rel=0.1)
