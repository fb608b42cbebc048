"""A speed that a driver reports behind a mild filter, whose noise is then larger where motions are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.late_speeds import record, swing

NOISE, CUTOFF_HZ, RATE_HZ = 0.03, 60.0, 500.0  # [rad/s] before the filter, and the filter's corner


def logged(filtered: bool) -> ArmRecording:
    """The pendulum's own speed, noisy, and behind the filter."""
    run = swing(damps_reported=False)
    made = record(run, 3, RATE_HZ)
    own = run.velocity[:: round(1000.0 / RATE_HZ), None]
    speed = own + NOISE * np.random.default_rng(4).standard_normal(own.shape)
    if filtered:
        pole = np.exp(-2.0 * np.pi * CUTOFF_HZ / RATE_HZ)
        speed = np.asarray(signal.lfilter([1.0 - pole], [1.0, -pole], speed, axis=0))
    return replace(made, states=replace(made.states, velocity=speed))


@pytest.mark.parametrize("filtered", [False, True])
def test_noise_of_a_speed_is_that_of_its_band(filtered: bool) -> None:
    """In the upper half of the spectrum, where white noise is read, the filter left a third of it."""
    recording = logged(filtered)
    trial = Trial(recording, RigidArm(recording.arm))
    speed = recording.states.velocity
    assert speed is not None
    assert trial.motion.noise.velocity == pytest.approx(NOISE, rel=0.2)
    if filtered:
        assert white_noise(speed, RATE_HZ).max() < 0.45 * NOISE
