"""A pendulum behind a servo: a joint of a position loop that nothing drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers.kind import ControllerKind
from samrl_core.cell.types.controllers.servos import PositionServo, VelocityDrive, VoltageServo
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from tests.diagnosis.controllers.test_passive_joint import TWO

JOINTS, PERIOD_S, SECONDS, NOISE_RAD = ("pivot", "elbow"), 0.005, 8.0, 1e-4
FAMILIES = {"viscous_friction", "coulomb_friction", "controller_gain", "torque_saturation"}
POSITION = {"stiffness": [40.0, 0.0], "damping": [1.5, 0.0]}
VOLTAGE = {
    "proportional": [20.0, 0.0], "derivative": [0.5, 0.0], "voltage_limit": [12.0, 0.0],
    "torque_constant": [0.02, 0.0], "resistance": [1.0, 0.0], "gear_ratio": [100.0, 1.0],
}  # fmt: skip


def controller(kind: ControllerKind, keys: dict[str, Any]) -> ArmController:
    return kind.read({"joints": list(JOINTS), "period_s": PERIOD_S, **keys}, JOINTS, "mapping")


def recording(of: ArmController, viscous: float, seed: int, logged: bool) -> ArmRecording:
    """The servo swings, and the elbow hangs from it; efforts as the law gives them, or not logged."""
    arm = ArmDescription("tool_arm", JOINTS, TWO, of)
    time = np.arange(0.0, SECONDS, PERIOD_S)
    swing = 0.6 * np.sin((1.5 + seed) * time) * (1.0 - np.exp(-(time**3)))
    goal = np.stack([swing, np.zeros_like(swing)], axis=1)
    command = JointSignal(time, goal, np.gradient(goal, PERIOD_S, axis=0), None, np.zeros_like(goal))
    plant = PlantParameters(viscous=np.array([0.0, viscous]))
    run = ClosedLoop(LoopModel(arm)).rollout(command, np.array([0.0, 0.5]), np.zeros(2), [plant], SECONDS)
    read = run.position[0] + NOISE_RAD * np.random.default_rng(seed).standard_normal(run.position[0].shape)
    states = JointSignal(run.time, read, np.gradient(read, run.time, axis=0))
    given = JointSignal(run.time, effort=run.commanded_effort[0]) if logged else None
    return ArmRecording(f"run {seed}", f"run{seed}", "", arm, states, command, given)


@pytest.mark.parametrize(
    ("kind", "keys", "logged"),
    [(PositionServo(), POSITION, True), (VoltageServo(), VOLTAGE, False)],
    ids=["torque, logged", "voltage, efforts not logged"],
)
def test_friction_of_a_joint_that_nothing_drives_is_told(
    kind: ControllerKind, keys: dict[str, Any], logged: bool
) -> None:
    """Such a machine was refused for its stiffness of 0; its residual of 0 over no noise was none either."""
    of, library = controller(kind, keys), DiagnosisSettings(library=FAMILIES)
    right = diagnose([recording(of, 0.0, 0, logged)], [recording(of, 0.0, 1, logged)], library)[0]
    assert right.verdict == "no_gap", right.reasons
    found = diagnose([recording(of, 0.01, 0, logged)], [recording(of, 0.01, 1, logged)], library)[0]
    assert "viscous_friction@joint:elbow" in [e.name for e in found.effects], found.reasons
    size = found.effects[0].parameters["Fv"]
    assert size.value == pytest.approx(0.01, rel=0.15)


def test_a_servo_that_drives_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"stiffness is \[0, 0\], must be above zero"):
        controller(PositionServo(), {"stiffness": [0, 0]})
    assert controller(VelocityDrive(), {"velocity_gain": [3.0, 0.0]}).damping.tolist() == [3.0, 0.0]
