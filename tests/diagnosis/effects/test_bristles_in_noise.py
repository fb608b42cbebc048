"""Friction that builds up over a distance no longer than an encoder's noise: NumPy alone."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.effects.friction.presliding import EFFECT, BuildingUp
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.trial import Trial

NOISE, RATE_HZ, STOPS_S = 1.4e-4, 125.0, 5.0


def recording(noise: float) -> ArmRecording:
    """One joint that stands still after five seconds, position alone, readings with a deviation [rad]."""
    time = np.arange(0.0, 10.0, 1.0 / RATE_HZ)
    position = 0.3 * np.cos(2.0 * np.pi * 0.2 * np.minimum(time, STOPS_S))
    position = position + noise * np.random.default_rng(1).standard_normal(len(time))
    states = JointSignal(time, position[:, None])
    arm = ArmDescription("tool_arm", ("swing",), None, None)
    return ArmRecording("run", "run", "", arm, states, JointSignal(time, position[:, None]), None)


def motion(noise: float) -> RecordedMotion:
    """The same on one clock."""
    return RecordedMotion(recording(noise), None)


def forms() -> tuple[BuildingUp, ...]:
    """The effect's forms at the joint."""
    trial = Trial(recording(NOISE), None)
    (place,) = EFFECT.places(trial)
    return tuple(f for f in EFFECT.forms(trial, place) if isinstance(f, BuildingUp))


@pytest.mark.parametrize("distance", [1.5e-4, 6e-4])
def test_noise_of_an_encoder_bends_no_bristle(distance: float) -> None:
    """Its own noise is in the residual as well, which it would seem to explain."""
    made, seen = forms(), motion(NOISE)
    still = seen.time > STOPS_S + 0.5
    assert len(made) == 2
    for form in made:
        friction = form.build_up(seen, 0, distance)
        assert np.max(np.abs(friction)) > 0.9, form.name
        assert np.std(np.diff(friction[still])) < 0.05, form.name
