"""A current that a drive reports filtered: its noise is as large as where motions are, and it is late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.residuals.signals.low_pass import find_low_pass
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.late_speeds import record, swing

BAND_HZ = 25.0
RATES = [(500.0, 0.004), (1000.0, 0.003), (500.0, 0.0025)]  # [Hz], time constant [s]


def filtered(x: np.ndarray, rate: float, lag_s: float) -> np.ndarray:
    """Samples (F, J) behind a first-order low-pass that takes each up with its exact share."""
    pole = np.exp(-1.0 / (rate * lag_s))
    return np.asarray(signal.lfilter([1.0 - pole], [1.0, -pole], x, axis=0))


def efforts(rate: float) -> np.ndarray:
    """Torques (F, 2) of a motion that reverses, without noise."""
    time = np.arange(0.0, 12.0, 1.0 / rate)
    speed = np.stack([np.cos(3.0 * time), np.cos(2.1 * time + 1.0)], axis=1)
    return 4.0 * np.sin(np.outer(time, [3.0, 2.1])) + 1.5 * np.tanh(speed / 0.01)


@pytest.mark.parametrize(("rate", "lag_s"), RATES)
def test_noise_tells_the_filter(rate: float, lag_s: float) -> None:
    """What the filter leaves of white noise is 2 to 6 times smaller at high frequencies than in the band."""
    noise = 0.3 * np.random.default_rng(5).standard_normal((round(12.0 * rate), 2))
    read = filtered(efforts(rate) + noise, rate, lag_s)
    found = find_low_pass(read, rate, BAND_HZ)
    assert 0.4 * lag_s < found.lag_s < 1.7 * lag_s
    assert white_noise(read, rate).max() < 0.15
    told = found.noise(read)
    in_band = 0.3 / np.sqrt(1.0 + (2.0 * np.pi * 0.6 * BAND_HZ * lag_s) ** 2)  # in the middle of it
    assert told == pytest.approx(in_band, rel=0.4)


@pytest.mark.parametrize(("rate", "cutoff"), [(500.0, 40.0), (1000.0, 60.0), (1000.0, 100.0)])
def test_noise_tells_a_filter_of_second_order(rate: float, cutoff: float) -> None:
    """Butterworth's, as in many drivers, which is late by the root of two over its angular frequency."""
    noise = 0.3 * np.random.default_rng(7).standard_normal((round(12.0 * rate), 2))
    filter_ = signal.butter(2, cutoff, fs=rate, output="sos")
    read = np.asarray(signal.sosfilt(filter_, efforts(rate) + noise, axis=0))
    found = find_low_pass(read, rate, BAND_HZ)
    assert found.form is not None and found.form.delay > 1.0
    assert found.lag_s == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi * cutoff), rel=0.5)
    told = found.noise(read)
    assert told == pytest.approx(0.3, rel=0.4)


@pytest.mark.parametrize("rate", [125.0, 500.0, 1000.0])
def test_white_noise_and_steps_are_no_filter(rate: float) -> None:
    """Reversals have spectra that fall as a filter's do; a sensor of its own noise has none."""
    noise = np.random.default_rng(6).standard_normal((round(12.0 * rate), 2))
    for level in (0.0, 0.01, 0.3):
        assert find_low_pass(efforts(rate) + level * noise, rate, BAND_HZ).form is None
    rising = np.diff(noise, axis=0)  # as a law makes of differenced positions
    assert find_low_pass(efforts(rate)[1:] + rising, rate, BAND_HZ).form is None
    assert find_low_pass(None, rate, BAND_HZ).form is None
    assert find_low_pass(noise[:100], rate, BAND_HZ).form is None


def logged(seed: int, lag_s: float) -> ArmRecording:
    """The pendulum on its loop, its current reported behind a filter."""
    made = record(swing(damps_reported=False), seed)
    made = replace(made, name=f"swing{seed}", states=replace(made.states, velocity=None))
    assert made.commanded_effort is not None and made.commanded_effort.effort is not None
    noise = np.random.default_rng([seed, 1]).standard_normal((len(made.states), 1))
    current = made.commanded_effort.effort + 0.08 * noise
    read = current if lag_s == 0.0 else filtered(current, 500.0, lag_s)
    return replace(made, commanded_effort=JointSignal(made.states.time, effort=read))


def test_residuals_are_as_noisy_as_the_current() -> None:
    plain, late = (Trial(r, RigidArm(r.arm)) for r in (logged(0, 0.0), logged(0, 0.004)))
    assert late.torque_lag > 0.0 and plain.torque_lag == 0.0
    for channel in ("controller", "dynamics"):
        ratio = np.median(late.sigma[channel]) / np.median(plain.sigma[channel])
        assert 0.6 < ratio < 1.6, channel


@pytest.mark.thorough
def test_a_filtered_current_is_no_gap() -> None:
    """Nothing is wrong with the machine: its loop, friction and inertia are as described."""
    settings = DiagnosisSettings(simulate=False)
    found, _ = diagnose([logged(0, 0.004), logged(1, 0.004)], [logged(2, 0.004)], settings)
    assert found.verdict == "no_gap", found.reasons
    assert any("low-pass" in note for note in found.notes)
