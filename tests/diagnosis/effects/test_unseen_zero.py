"""Where a joint's zero shows in no torque, the report says so."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmController, ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects.sensor.encoder_offset import EFFECT
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

ONE = (
    '<robot name="one"><link name="base"/><link name="part"><inertial><origin xyz="0.2 0 0"/>'
    '<mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>'
    '<joint name="axis" type="{kind}"><parent link="base"/><child link="part"/><axis xyz="{axis}"/>'
    '<limit lower="-2" upper="2" effort="20" velocity="3"/></joint></robot>'
)


def trial(kind: str, axis: str, logged: bool) -> Trial:
    """A servo of one joint, with torques in its log or with its law alone."""
    law = ArmController(("axis",), np.array([50.0]), np.array([3.0]))
    arm = ArmDescription("tool_arm", ("axis",), ONE.format(kind=kind, axis=axis), law)
    time = np.arange(0.0, 6.0, 0.005)
    goal = 0.5 * np.sin(2.0 * time)[:, None]
    speed = np.gradient(goal, time, axis=0)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(goal.shape)
    states, command = JointSignal(time, goal + noise, speed), JointSignal(time, goal, speed)
    given = JointSignal(time, effort=2.0 * np.cos(goal)) if logged else None
    return Trial(ArmRecording("a", "a", "", arm, states, command, given), RigidArm(arm))


@pytest.mark.parametrize("logged", [True, False], ids=["torque", "law"])
@pytest.mark.parametrize(
    ("kind", "axis", "shows"),
    [("revolute", "0 0 1", False), ("prismatic", "0 0 1", False), ("revolute", "0 1 0", True)],
    ids=["upright", "slide", "lying"],
)
def test_a_zero_that_no_torque_shows_has_its_reason(kind: str, axis: str, shows: bool, logged: bool) -> None:
    """Servos on upright axes and slides had neither an offset of the encoder nor a reason for that."""
    why = EFFECT.why_unobservable(trial(kind, axis, logged))
    assert why is None if shows else why is not None and "upright axis or a slide" in why
