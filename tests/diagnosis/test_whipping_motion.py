"""Motion above the band makes torques within it: the model passes the band after its formula, as they did."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis import worlds


def whipping(differenced: bool) -> ArmRecording:
    """Noiseless, 500 Hz: the last link whips round, its speed swings; torques of an exact model."""
    time = np.arange(0.0, 6.0, 0.002)
    phase, rate = 2.2 * 2 * np.pi * time, 2.2 * 2 * np.pi
    q = np.stack([0.3 * np.sin(time), 0.2 * np.cos(2 * time), phase + 0.7 * np.sin(2 * phase)], axis=1)
    dq = np.stack(
        [0.3 * np.cos(time), -0.4 * np.sin(2 * time), rate + 1.4 * rate * np.cos(2 * phase)], axis=1
    )
    ddq = np.stack([-0.3 * np.sin(time), -0.8 * np.cos(2 * time), -2.8 * rate**2 * np.sin(2 * phase)], axis=1)
    arm = replace(worlds.arm(), controller=None)  # no rotors either
    torque = RigidArm(arm).inverse_dynamics(q, dq, ddq)
    states = JointSignal(time, q, None if differenced else dq)
    return ArmRecording("whip", "whip", "", arm, states, None, JointSignal(time, effort=torque))


@pytest.mark.parametrize("differenced", [True, False])
def test_what_a_whipping_motion_takes_is_no_gap(differenced: bool) -> None:
    (trial,) = worlds.trials([whipping(differenced)])
    assert trial.motion.u is not None
    left, torque = trial.equations.residual["dynamics"], trial.motion.u
    middle = slice(len(left) // 10, -(len(left) // 10))
    share = np.std(left[middle], axis=0) / np.std(torque[middle], axis=0)
    assert share.max() < 0.02, share
