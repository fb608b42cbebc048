"""What noise does to residuals and regressors, judged by noise and motions that are made here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from samrl_core.blind_test.scores.study import Study
from samrl_core.blind_test.servo_worlds.plan import ServoSettings, plan_servos
from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.signals.noise_color import NoiseColor
from samrl_core.diagnosis.residuals.signals.signal_noise import (
    highest_sure_frequency,
    is_difference,
    white_noise,
    without_differences,
)
from samrl_ros.blind_test.servo_runs import ServoMaking, make_servo
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.log_import.any_importer import import_any

BAND, DT = 25.0, 0.008


def differenced_noise(rng: np.random.Generator, count: int) -> np.ndarray:
    """Accelerations (N,) from white velocities by the derivative's own gain, 2 pi f, up to the band."""
    frequency = np.fft.rfftfreq(count, DT)
    gain = 2 * np.pi * frequency * (frequency <= BAND)
    x = np.fft.irfft(np.fft.rfft(rng.normal(size=count)) * gain, count)
    return x / x.std()


def test_noise_of_accelerations_becomes_white() -> None:
    color = NoiseColor(np.array([1.0]), 2, BAND, DT)
    noise = differenced_noise(np.random.default_rng(1), 40_000)
    frequency, before = signal.welch(noise, fs=1 / DT, nperseg=1024)
    _, after = signal.welch(color.whitened(noise, 0), fs=1 / DT, nperseg=1024)
    low, high = (frequency > 2.5) & (frequency < 5), (frequency > 19) & (frequency < 23)
    assert before[high].mean() / before[low].mean() > 20
    assert after[high].mean() / after[low].mean() == pytest.approx(1.0, rel=0.1)
    inside = (frequency > 2.5) & (frequency < 23)
    assert after[inside].mean() * BAND == pytest.approx(1.0, rel=0.1)  # a variance of one, evenly spread


@pytest.mark.parametrize("count", [300, 700, 1200, 12_000])
def test_white_noise_has_its_level_in_short_logs_too(count: int) -> None:
    """The median of a spectrum of one stretch is three tenths below its mean: noise was a sixth too small."""
    noise = np.random.default_rng(3).normal(size=(count, 200))
    assert np.mean(white_noise(noise, 100.0)) == pytest.approx(1.0, rel=0.02)


def test_a_slow_signal_under_fast_noise_stands_out_more() -> None:
    """Matched filter: the evidence of 1 N m at 1 Hz under differenced noise of 5, before and after."""
    color = NoiseColor(np.array([1.0]), 2, BAND, DT)
    wave = np.sin(2 * np.pi * 1.0 * DT * np.arange(1500)) / 5.0
    assert np.sum(color.whitened(wave, 0) ** 2) > 30 * np.sum(wave**2)


def test_color_comes_back_and_little_changes_nothing() -> None:
    rng = np.random.default_rng(2)
    noise = differenced_noise(rng, 3000)
    color = NoiseColor(np.array([0.8, 0.05]), 2, BAND, DT)
    back = color.colored(color.whitened(noise, 0), 0)
    assert back[200:-200] == pytest.approx(noise[200:-200], abs=0.02)
    assert color.whitened(noise, 1) is noise


def test_where_a_motion_ends_and_noise_begins() -> None:
    rng, rate = np.random.default_rng(3), 250.0
    time = np.arange(0, 12, 1 / rate)
    read = np.stack([np.sin(2 * np.pi * 3 * time), np.zeros_like(time)], axis=1)
    read += 0.05 * rng.normal(size=read.shape)
    found = highest_sure_frequency(read, np.array([0.05, 0.05]), rate)
    assert 3.0 <= found[0] < 5.0
    assert found[1] == 0.0


def recording(rate: float, hertz: float, velocity: bool) -> ArmRecording:
    time = np.arange(0, 10, 1 / rate)
    q = np.sin(2 * np.pi * hertz * time)[:, None]
    dq = 2 * np.pi * hertz * np.cos(2 * np.pi * hertz * time)[:, None]
    states = JointSignal(time, q, dq if velocity else None, None, None)
    arm = ArmDescription("tool_arm", ("j",), None, None)
    return ArmRecording("sine", "made here", "", arm, states, None, None)


@pytest.mark.parametrize("velocity", [True, False])
def test_accelerations_of_a_slow_log_lose_nothing(velocity: bool) -> None:
    """Central differences of a 4 Hz sine at 125 Hz would lose 0.7 %, or 1.3 % twice."""
    motion = RecordedMotion(recording(125.0, 4.0, velocity), None)
    turn = 2 * np.pi * 4.0 * motion.t[50:-50]
    waves = np.stack([np.sin(turn), np.cos(turn)], axis=1)
    size = np.linalg.norm(np.linalg.lstsq(waves, motion.ddq[50:-50, 0], rcond=None)[0])
    assert size == pytest.approx((2 * np.pi * 4.0) ** 2, rel=0.002)


def test_a_differenced_velocity_is_no_reading() -> None:
    real = recording(125.0, 1.0, True).states
    assert without_differences(real) is real
    made = JointSignal(real.time, real.position, np.gradient(real.position, real.time, axis=0), None, None)
    assert without_differences(made).velocity is None


def test_a_difference_that_looks_back_is_no_reading() -> None:
    """A hardware interface's (q - q_before) / period is half a period late: 5 ms of a leg made a gap."""
    real = recording(100.0, 1.0, True).states
    assert real.position is not None
    behind = np.diff(real.position, axis=0, prepend=real.position[:1]) * 100.0
    stamps = real.time + np.random.default_rng(3).uniform(0.0, 2e-5, len(real.time))
    kept = np.arange(len(stamps)) % 200 != 77  # some rows are lost
    made = JointSignal(stamps[kept], real.position[kept], behind[kept], None, None)
    assert without_differences(made).velocity is None
    assert real.velocity is not None
    own = real.velocity + np.random.default_rng(4).normal(0.0, 0.02, real.velocity.shape)
    measured = JointSignal(stamps[kept], real.position[kept], own[kept], None, None)
    assert without_differences(measured) is measured


@pytest.mark.parametrize("central", [True, False])
def test_a_commands_speed_that_looks_back_is_the_one_that_is_fed(central: bool) -> None:
    states = recording(100.0, 1.0, True).states
    assert states.position is not None
    q, time = states.position, states.time
    speed = np.gradient(q, time, axis=0) if central else np.diff(q, axis=0, prepend=q[:1]) * 100.0
    assert is_difference(JointSignal(time, q, speed, None, None)) == central


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4101, 4102])
def test_servo_machines_as_described_show_no_gap(seed: int, tmp_path: Path) -> None:
    """Another engine's machines within their tolerances, logged coarsely; seeds that nothing was tuned on."""
    settings = ServoSettings(seed, single=0, none=5, outside=0, double=0)
    for item in plan_servos(settings):
        make_servo(ServoMaking(tmp_path, item))
        folder, bags = Study(tmp_path).observations(item.id), tmp_path / "bags" / item.id
        import_any(folder / "mapping.yaml", folder, bags)
        options = DiagnoseOptions((bags / "A.mcap", bags / "B.mcap"), held_out=(bags / "C.mcap",))
        fit, held_out, notes = load(options)
        found = diagnose(fit, held_out, DiagnosisSettings(share_held_out=False), notes)[0]
        assert found.verdict == "no_gap", (item.mechanism, item.drive, found.reasons)
