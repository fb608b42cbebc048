"""A stated spring whose joint is read in coarse steps: the steps' torque is noise, and no gap."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

INERTIA, STIFFNESS, DAMPING, RATE_HZ = 0.004, 1.35, 0.004, 500.0
URDF = (
    '<robot name="f"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 0"/><mass value="0.13"/>'
    f'<inertia ixx="1e-5" ixy="0" ixz="0" iyy="{INERTIA}" iyz="0" izz="{INERTIA}"/></inertial></link>'
    '<joint name="alpha" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="0.5" velocity="20"/>'
    f'<dynamics friction="0" damping="{DAMPING}" stiffness="{STIFFNESS}" springref="0"/></joint></robot>'
)


def let_go(step: float) -> Trial:
    """A flexible joint that swings out by itself, read in steps [rad]."""
    time = np.arange(0.0, 8.0, 1.0 / RATE_HZ)
    decay, square = DAMPING / (2.0 * INERTIA), STIFFNESS / INERTIA
    swing = 0.1 * np.exp(-decay * time) * np.cos(np.sqrt(square - decay**2) * time + 0.3)
    angle = np.round(swing / step) * step
    arm = ArmDescription("tool_arm", ("alpha",), URDF, None)
    states = JointSignal(time, angle[:, None], None, None, None)
    sent = JointSignal(time, None, None, None, np.zeros((len(time), 1)))
    return Trial(ArmRecording("let go", "made here", "", arm, states, None, sent), RigidArm(arm))


@pytest.mark.parametrize("counts", [1024, 4096])
def test_steps_of_an_encoder_are_within_the_noise(counts: int) -> None:
    """Noise of accelerations rises with frequency, that of a spring does not: 97 % of a gap was its steps."""
    trial = let_go(2 * np.pi / counts)
    scaled = (trial.residual["dynamics"] / trial.equations.sigma["dynamics"]).T
    white = trial.equations.color["dynamics"].whitened(scaled, 0)[0][20:-20]
    assert np.sqrt(np.mean(white**2)) < 1.2
