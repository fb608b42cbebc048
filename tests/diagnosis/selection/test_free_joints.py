"""What counts as a gap where no loop holds a joint: what machines within tolerance do there as well."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers.kind import ControllerKind
from samrl_core.cell.types.controllers.motors import CurrentMotor
from samrl_core.cell.types.controllers.servos import PositionServo
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.gap_metric import runs_away, shrink
from samrl_core.diagnosis.selection.resimulation import gap, resimulate
from samrl_core.diagnosis.simulation.closed_loop import ClosedLoop
from samrl_core.diagnosis.simulation.loop_model import LoopModel
from samrl_core.diagnosis.simulation.plant_parameters import PlantParameters
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

JOINTS, RATE_HZ, SECONDS = ("body", "wheel"), 200.0, 6.0
NOISE_RAD, NOISE_RAD_S = 2e-4, 1e-3
WHEEL = """<robot name="w"><link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.12"/><mass value="0.46"/>
<inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.0002"/></inertial></link>
<joint name="body" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit effort="2" velocity="20"/></joint>
<link name="rim"><inertial><mass value="0.21"/>
<inertia ixx="0.0002" ixy="0" ixz="0" iyy="0.0004" iyz="0" izz="0.0002"/></inertial></link>
<joint name="wheel" type="continuous"><origin xyz="0 0 -0.18"/><parent link="rod"/><child link="rim"/>
<axis xyz="0 1 0"/>
<limit effort="0.5" velocity="250"/></joint></robot>"""
CURRENT = {"torque_constant": [0.0, 0.064], "rotor_inertia": [0.0, 1.1e-5]}
SERVO = {"stiffness": [0.0, 0.3], "damping": [0.0, 0.02]}
TOLERATED = Tolerances(0.02, 0.001, 0.03, *[(1e-4, 5e-4)] * 3, base_tilt=0.0)


def _machine(kind: ControllerKind, keys: Mapping[str, object]) -> ArmDescription:
    controller = kind.read({"joints": list(JOINTS), "period_s": 1 / RATE_HZ, **keys}, JOINTS, "mapping")
    return ArmDescription("tool_arm", JOINTS, WHEEL, controller, tolerances=TOLERATED)


def _raised(arm: ArmDescription, height: float) -> np.ndarray:
    """Change (2, 10) of the inertial parameters where the body's centre of mass is higher [m]."""
    change = np.zeros((2, 10))
    change[0, 3] = height * RigidArm(arm).inertial_parameters[0][0]
    return change


def _recorded(arm: ArmDescription, plant: PlantParameters) -> Trial:
    """A body that swings under a wheel's jerks."""
    time = np.arange(0.0, SECONDS, 1 / RATE_HZ)
    torque = 0.05 * np.sin(2.1 * time) * np.sin(5.0 * time)
    drive = np.stack([np.zeros_like(time), torque], axis=1)
    goal = np.stack([np.zeros_like(time), 3.0 * np.sin(2.1 * time)], axis=1)
    command = JointSignal(time, goal, np.gradient(goal, time, axis=0), None, drive)
    run = ClosedLoop(LoopModel(arm)).rollout(command, np.array([1.0, 0.0]), np.zeros(2), [plant], SECONDS)
    noise = np.random.default_rng(1).standard_normal((2, *run.position[0].shape))
    states = JointSignal(
        run.time, run.position[0] + NOISE_RAD * noise[0], run.velocity[0] + NOISE_RAD_S * noise[1]
    )
    given = JointSignal(run.time, effort=run.commanded_effort[0])
    return Trial(ArmRecording("run", "run", "", arm, states, command, given), RigidArm(arm))


@pytest.mark.parametrize(
    ("kind", "keys"),
    [(CurrentMotor(), CURRENT), (PositionServo(), SERVO)],
    ids=["open loop", "a loop at the other joint"],
)
def test_a_body_that_swings_as_it_should_is_no_smaller_for_a_wheel_that_drifts(
    kind: ControllerKind, keys: Mapping[str, object]
) -> None:
    """With the right body a wheel was still up to 150 "tolerances" off: of a stiffness that it never had."""
    arm = _machine(kind, keys)
    assert arm.controller is not None and runs_away(arm.controller)
    raised = _raised(arm, 0.02)
    drag = PlantParameters(viscous=np.array([0.0, 1e-6]))  # of the wheel: nobody stated it, nobody minds
    trial = _recorded(arm, replace(drag, inertial_delta=raised))
    run = resimulate(
        trial,
        [
            (
                0.0,
                {
                    "nominal": PlantParameters(),
                    "raised": PlantParameters(inertial_delta=raised),
                    "drag": drag,
                },
            )
        ],
    )
    nominal, raised_center, other = (gap([run], name) for name in ("nominal", "raised", "drag"))
    assert nominal > 2.0
    assert raised_center < 1.0
    assert abs(shrink(nominal, other)) < 0.1


def test_a_machine_within_its_tolerances_shows_a_gap_of_about_one() -> None:
    arm = _machine(CurrentMotor(), CURRENT)
    trial = _recorded(arm, PlantParameters(inertial_delta=_raised(arm, TOLERATED.center_of_mass)))
    assert 0.3 < gap([resimulate(trial, [(0.0, {"nominal": PlantParameters()})])], "nominal") < 2.0


def test_what_began_later_acts_in_the_pieces_from_then_on() -> None:
    """After its onset a plant of an open loop went on to the end without a new start, and ran away."""
    trial = _recorded(_machine(CurrentMotor(), CURRENT), PlantParameters())
    stages = [
        (0.0, {"nominal": PlantParameters()}),
        (3.0, {"nominal": PlantParameters(viscous=np.full(2, 0.05))}),
    ]
    run = resimulate(trial, stages)
    error = np.abs(run.measured["position"] - run.simulated["nominal"]["position"])[:, 0]
    before, later = run.time < 2.9, run.time > 3.1
    assert error[before].max() < 10 * NOISE_RAD
    assert 100 * NOISE_RAD < error[later].max()
    assert error[later & (run.time % 1.0 < 0.02)].max() < 0.1 * error[later].max()
