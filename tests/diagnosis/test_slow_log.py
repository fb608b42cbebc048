"""Industrial arms log at ten samples a second: enough where the motion is slower, and then only."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.effects.effect import lacks_drive_torque
from samrl_core.diagnosis.kinds.arms import Arms, arm_trials
from samrl_core.diagnosis.residuals.signals.signal_noise import follows
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.foreign import read_runs

MASS, LENGTH, G, RATE_HZ = 2.0, 0.6, 9.81, 10.0
INERTIA = MASS * LENGTH**2 / 3
URDF = (
    '<robot name="p"><link name="base"/><link name="rod"><inertial>'
    f'<origin xyz="0 0 {-LENGTH / 2}"/><mass value="{MASS}"/><inertia ixx="{MASS * LENGTH**2 / 12}" ixy="0"'
    f' ixz="0" iyy="{MASS * LENGTH**2 / 12}" iyz="0" izz="1e-4"/></inertial></link>'
    '<joint name="q1" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>'
    '<limit lower="-3" upper="3" effort="20" velocity="3"/></joint></robot>'
)
LIBRARY = DiagnosisSettings(
    library={"viscous_friction", "coulomb_friction", "payload", "torque_rate_limit", "torque_saturation"}
)


def swing(path: Path, coulomb: float, seed: int, pace: float = 1.0) -> ArmRecording:
    """A driven pendulum that tracks three sines below 0.4 Hz, times `pace`."""
    rng = np.random.default_rng(seed)
    speed, phase = pace * 2 * np.pi * rng.uniform(0.08, 0.4, 3), rng.uniform(0, 2 * np.pi, 3)
    time = np.arange(0.0, 60.0, 1.0 / RATE_HZ)

    def torque(t: float, q: float, v: float) -> float:
        wanted = 0.3 * np.sin(speed * t + phase).sum()
        return 120.0 * (wanted - q) + 14.0 * (0.3 * (speed * np.cos(speed * t + phase)).sum() - v)

    def rate(t: float, y: np.ndarray) -> list[float]:
        lost = coulomb * np.tanh(y[1] / 0.01) + 0.5 * MASS * G * LENGTH * np.sin(y[0])
        return [y[1], (torque(t, *y) - lost) / INERTIA]

    q, v = solve_ivp(rate, (0.0, 60.0), [0.0, 0.0], t_eval=time, method="LSODA", rtol=1e-8, atol=1e-9).y
    sent = [torque(*row) for row in zip(time, q, v, strict=True)]
    rows = np.column_stack([time, q, v, sent])
    rows[:, 1:] += rng.standard_normal((len(time), 3)) * [2e-5, 1e-3, 0.05]
    np.savetxt(path, rows, delimiter=",", header="time,q1_rad,dq1_rad_s,tau1_Nm", comments="", fmt="%.7f")
    return read_runs(path, URDF, None, Effort.drive)[0][0]


@pytest.mark.parametrize("coulomb", [0.0, pytest.param(1.2, marks=pytest.mark.thorough)])
def test_a_slow_motion_is_diagnosed(coulomb: float, tmp_path: Path) -> None:
    fit, held_out = (swing(tmp_path / f"{k}.csv", coulomb, k) for k in (1, 2))
    diagnosis, _ = diagnose([fit], [held_out], LIBRARY)
    if not coulomb:
        assert diagnosis.verdict == "no_gap", diagnosis.reasons
        return
    (effect,) = diagnosis.effects
    assert (effect.family, effect.place) == ("coulomb_friction", "joint:q1")
    assert effect.parameters["Fc"].value == pytest.approx(coulomb, rel=0.1)


def test_a_motion_that_outruns_its_log_is_not(tmp_path: Path) -> None:
    fit, held_out = (swing(tmp_path / f"{k}.csv", 0.0, k, pace=8.0) for k in (1, 2))
    diagnosis, _ = diagnose([fit], [held_out], LIBRARY)
    assert diagnosis.verdict == "not_testable"
    assert "10 Hz" in diagnosis.reasons[0]


@pytest.mark.parametrize(("frequency", "told"), [(0.7, True), (1.5, True), (4.0, False)])
def test_half_the_samples_tell_the_others(frequency: float, told: bool) -> None:
    time = np.arange(0.0, 30.0, 0.1)[:, None]
    assert follows(np.sin(2 * np.pi * frequency * time), 2) == told
    assert follows(np.cos(2 * np.pi * frequency * time), 1) == told
    assert not follows(np.random.default_rng(0).standard_normal((300, 1)), 1)


def test_sixty_frames_a_second_are_enough_whichever_side_their_clock_errs(tmp_path: Path) -> None:
    """Of a servo leg's four recordings at 60 Hz two were left out, the one held out among them."""
    fast = swing(tmp_path / "fast.csv", 0.0, 3, 12.0)
    times = fast.states.time / (6.0 * np.array([[0.995], [1.005]]))
    a, b = (replace(fast, commanded_effort=None, states=replace(fast.states, time=t)) for t in times)
    fitted, held_out, notes = Arms().usable([a], [b])
    assert (len(fitted), len(held_out), notes) == (1, 1, [])


def test_a_recording_that_moves_too_fast_is_left_out(tmp_path: Path) -> None:
    """Beside one that its rate tells, whether both are fitted or one is held out; it says so."""
    told = swing(tmp_path / "told.csv", 0.0, 1)
    fast = replace(swing(tmp_path / "fast.csv", 0.0, 3, 12.0), name="fast")
    fitted, held_out, notes = Arms().usable([told, fast], [fast])
    assert list(fitted) == [told] and not held_out
    assert len(notes) == 2 and "fast does not tell accelerations at 10 Hz" in notes[0]
    assert "log at 60 Hz or more" in notes[0]
    diagnosis, _ = diagnose([told, fast], [told], LIBRARY)
    assert diagnosis.verdict == "no_gap" and any("fast is left out" in note for note in diagnosis.notes)
    diagnosis, _ = diagnose([fast], [told], LIBRARY)
    assert diagnosis.verdict == "not_testable" and "moves faster" in diagnosis.reasons[0]


def test_torques_that_no_slow_log_can_use_are_said_to_be_unused() -> None:
    """Beside a command the log was testable, and its efforts were called missing."""
    time = np.arange(0.0, 30.0, 1.0 / RATE_HZ)
    wave = np.sin(2 * np.pi * 4.0 * time)[:, None]
    states, command = (JointSignal(time, x, None, None, None) for x in (wave, 1.01 * wave))
    arm = ArmDescription("tool_arm", ("q1",), URDF, None)
    sent = JointSignal(time, None, None, None, wave)
    (trial,), _ = arm_trials([ArmRecording("fast", "made here", "", arm, states, command, sent)], [])
    assert trial.channels == ("tracking",)
    assert "moves faster than that tells" in str(lacks_drive_torque(trial))
    (note,) = Arms().notes([trial])
    assert note.startswith("the recorded torques are not used: ") and "log at 60 Hz or more" in note
