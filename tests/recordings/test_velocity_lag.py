"""A velocity that a driver filtered from the positions is told by its lag, whatever encoder and jitter do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.recordings.velocity_lag import is_filtered, velocity_lag

FINE_HZ, TICK = 4000.0, 2.0 * np.pi / 8192.0  # of the plant, and an encoder's step [rad]
TIME = np.arange(0.0, 12.0, 1.0 / FINE_HZ)
MOTION = np.stack(
    [np.sin(5.0 * TIME) + 0.3 * np.sin(13.0 * TIME), 0.7 * np.cos(3.0 * TIME), 0.0 * TIME], axis=1
)


def log(rate: float, velocity: np.ndarray) -> JointSignal:
    """Counted positions, and velocities as they are, of every so many samples of the plant."""
    stride = round(FINE_HZ / rate)
    counted = TICK * np.round(MOTION / TICK)
    return JointSignal(TIME[::stride], counted[::stride], velocity[::stride], None)


@pytest.mark.parametrize(("rate", "cutoff"), [(500.0, 60.0), (1000.0, 60.0), (250.0, 25.0)])
def test_a_filter_shows_by_its_lag(rate: float, cutoff: float) -> None:
    """Differences at the driver's 4 kHz, first order at the cut-off: late by 1 / (2 pi cutoff)."""
    counted = TICK * np.round(MOTION / TICK)
    differences = np.diff(counted, axis=0, prepend=counted[:1]) * FINE_HZ
    made = log(rate, signal.sosfilt(signal.butter(1, cutoff, fs=FINE_HZ, output="sos"), differences, axis=0))
    assert velocity_lag(made) == pytest.approx(1.0 / (2.0 * np.pi * cutoff), rel=0.1)
    assert is_filtered(made)


def test_a_tachometer_and_a_simulation_are_not_late() -> None:
    """White noise of its own; and v of a semi-implicit step, which is half a step of a millisecond behind."""
    true = np.gradient(MOTION, 1.0 / FINE_HZ, axis=0)
    noise = np.random.default_rng(3).normal(0.0, 0.02, true.shape)
    assert not is_filtered(log(500.0, true + noise))
    behind = np.roll(true, 2, axis=0)
    assert not is_filtered(log(500.0, behind))


def test_a_period_of_a_fast_loop_is_no_filter() -> None:
    """The EMPS slide's velocity is 1.0006 ms behind its positions, a period of its log: no low-pass."""
    true = np.gradient(MOTION, 1.0 / FINE_HZ, axis=0)
    made = log(1000.0, np.roll(true, 4, axis=0))
    assert velocity_lag(made) == pytest.approx(0.001, rel=0.02)
    assert not is_filtered(made)


def test_differences_of_the_log_are_no_filter() -> None:
    """They look back by half a period: nothing is gained by differences anew."""
    made = log(250.0, np.zeros_like(MOTION))
    assert made.position is not None
    backward = np.diff(made.position, axis=0, prepend=made.position[:1]) * 250.0
    looking_back = JointSignal(made.time, made.position, backward, None)
    assert velocity_lag(looking_back) == pytest.approx(0.002, rel=0.1)
    assert not is_filtered(looking_back)


def test_what_does_not_move_or_is_short_tells_nothing() -> None:
    still = JointSignal(TIME[::8], np.zeros((6000, 2)), np.zeros((6000, 2)), None)
    assert velocity_lag(still) == 0.0
    assert velocity_lag(JointSignal(TIME[:50], MOTION[:50], MOTION[:50], None)) == 0.0
