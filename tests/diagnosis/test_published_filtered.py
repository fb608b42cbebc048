"""A log that was filtered forwards and backwards and thinned out before it was published, as SARCOS' is.

Its noise is that of the band; where white noise would be read there is a thirtieth of its power, and an arm
with nothing wrong had a gap without a cause.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.residuals.motion import DIFFERENCED_HZ
from samrl_core.diagnosis.residuals.signals.low_pass import OFFLINE, find_offline_filter
from samrl_core.diagnosis.residuals.signals.signal_noise import white_noise, without_filtered_rate

FAST_HZ, EVERY, JOINTS = 1000.0, 10, 3
RATE_HZ, BAND_HZ = FAST_HZ / EVERY, 20.0
TIME = np.arange(0.0, 30.0, 1.0 / FAST_HZ)


def moved() -> np.ndarray:
    """(F, J) rad."""
    return np.stack(
        [np.sin((2.0 + j) * TIME + j) + 0.2 * np.sin(9.0 * TIME + j) for j in range(JOINTS)], axis=1
    )


def published(x: np.ndarray, order: int, corner_hz: float) -> np.ndarray:
    low = signal.butter(order, corner_hz, fs=FAST_HZ, output="sos")
    return np.asarray(signal.sosfiltfilt(low, x, axis=0)[::EVERY])


@pytest.mark.parametrize(("order", "corner_hz"), [(2, 25.0), (3, 22.0), (4, 30.0)])
def test_noise_behind_it_is_that_of_the_band(order: int, corner_hz: float) -> None:
    noise = 0.5 * np.random.default_rng(order).standard_normal((len(TIME), JOINTS))
    read = published(5.0 * moved() + noise, order, corner_hz)
    found = find_offline_filter(read, RATE_HZ, BAND_HZ)
    assert found.form in OFFLINE and found.lag_s == 0.0
    assert found.corner * RATE_HZ == pytest.approx(corner_hz, rel=0.25)
    there = published(noise, order, corner_hz)
    low = signal.butter(3, BAND_HZ, fs=RATE_HZ, output="sos")
    in_band = np.std(signal.sosfiltfilt(low, there, axis=0), axis=0)
    told = found.noise(read) * np.sqrt(2.0 * BAND_HZ / RATE_HZ)
    np.testing.assert_allclose(told, in_band, rtol=0.3)
    assert (white_noise(read, RATE_HZ) < 0.7 * found.noise(read)).all()


@pytest.mark.parametrize("seed", range(6))
def test_none_is_found_in_white_noise_or_behind_a_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    read = moved()[::EVERY] + 10.0 ** rng.uniform(-5, -2) * rng.standard_normal((len(TIME) // EVERY, JOINTS))
    assert find_offline_filter(read, RATE_HZ, BAND_HZ).form is None
    turns = np.sign(np.sin(3.0 * TIME[::EVERY]))[:, None] + 1e-3 * rng.standard_normal((len(read), 1))
    assert find_offline_filter(turns, RATE_HZ, BAND_HZ).form is None


def states(own: float) -> JointSignal:
    """Positions and velocities worked out of them at 1 kHz, with readings' noise `own` [rad/s] of its own."""
    rng = np.random.default_rng(3)
    q = moved() + 8e-5 * rng.standard_normal((len(TIME), JOINTS))
    low = signal.butter(2, 25.0, fs=FAST_HZ, output="sos")
    filtered = signal.sosfiltfilt(low, q, axis=0)
    dq = np.gradient(filtered, 1.0 / FAST_HZ, axis=0)
    dq = dq + signal.sosfiltfilt(low, own * rng.standard_normal(dq.shape), axis=0)
    return JointSignal(TIME[::EVERY], filtered[::EVERY], dq[::EVERY])


@pytest.mark.parametrize(("own", "kept"), [(0.0, False), (0.05, True)])
def test_a_velocity_worked_out_before_is_no_reading(own: float, kept: bool) -> None:
    assert (without_filtered_rate(states(own), DIFFERENCED_HZ).velocity is not None) is kept


def test_what_was_not_filtered_keeps_its_velocity() -> None:
    q = moved()[::EVERY]
    noisy = q + 1e-5 * np.random.default_rng(1).standard_normal(q.shape)
    log = JointSignal(TIME[::EVERY], noisy, np.gradient(noisy, 1.0 / RATE_HZ, axis=0) * 1.001)
    assert without_filtered_rate(log, DIFFERENCED_HZ).velocity is not None
