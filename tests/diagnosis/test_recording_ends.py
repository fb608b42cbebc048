"""Logs that begin and end in mid-motion: no filter knows what lies beyond."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from tests.diagnosis.worlds import arm


@pytest.mark.parametrize("with_velocity", [True, False])
@pytest.mark.parametrize(("rate", "seconds"), [(125.0, 10.0), (500.0, 6.0)])
def test_accelerations_are_right_from_the_first_sample_to_the_last(
    rate: float, seconds: float, with_velocity: bool
) -> None:
    time = np.arange(0.0, seconds, 1.0 / rate)
    omega, size = 2.0 * np.pi * np.array([0.5, 0.9, 1.3]), np.array([0.4, 0.3, 0.2])
    turn = omega * time[:, None] + np.array([1.2, 1.6, 2.0])  # begins near the strongest acceleration
    velocity = size * omega * np.cos(turn) if with_velocity else None
    states = JointSignal(time, size * np.sin(turn), velocity)
    recording = ArmRecording("sines", "-", "0" * 64, arm(), states, None, None)
    motion = RecordedMotion(recording, None)
    real = -size * omega**2 * np.sin(omega * motion.t[:, None] + np.array([1.2, 1.6, 2.0]))
    assert np.abs(motion.ddq - real).max() < 0.005 * np.abs(real).max()
    assert motion.t[0] - time[0] <= 0.04 * seconds + 1.0 / rate
