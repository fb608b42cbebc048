"""A stepper's field turns a radian while stamps are off by 0.2 ms: no straight line, and no friction."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import controller_from
from samrl_core.diagnosis.effects.friction.viscous_friction import EFFECT as VISCOUS
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.field_time import with_field_time
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence

MASS, ROTOR, TURNS = 1.8, 6.8e-6, 2 * np.pi / 0.04  # [kg], [kg m2], motor rad per metre of belt
HOLDING, DAMPING, RATE = 1.1, 40.0, 500.0  # [N m], [N s/m], [Hz] of the log
LIFT = f"""<robot name="lift"><link name="base"/><link name="carriage"><inertial>
<mass value="{MASS}"/><inertia ixx="0.004" iyy="0.004" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="z" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="170" velocity="1"/></joint></robot>"""
ABOUT = {
    "type": "stepper", "joints": ["z"], "holding_torque": [HOLDING], "gear_ratio": [TURNS],
    "damping": [DAMPING], "rotor_inertia": [ROTOR],
}  # fmt: skip
LATE_S = 0.15e-3  # well within half a sample


def lift(name: str, seed: int, late: float, reach: float = 0.12) -> ArmRecording:
    """A carriage on sines of up to 2.1 Hz, and microsteps that move it so, stamped too early by `late`."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(5.0 * RATE)) / RATE
    steps, phases = rng.normal(size=6), rng.uniform(0, 2 * np.pi, 6)
    turn = 2 * np.pi * 0.35 * np.arange(1, 7)
    size = reach / np.sum(np.abs(steps))

    def moved(at: np.ndarray, order: int) -> np.ndarray:
        angle = turn * at[:, None] + phases + 0.5 * np.pi * order
        return size * (turn**order * np.sin(angle)) @ steps

    ahead = time + late
    load = (MASS + ROTOR * TURNS**2) * moved(ahead, 2) + MASS * 9.81 + DAMPING * moved(ahead, 1)
    pole, microstep = 50 * TURNS, 0.04 / 3200
    goal = moved(ahead, 0) + np.arcsin(load / (HOLDING * TURNS)) / pole
    read = moved(time, 0) + 2e-7 * rng.standard_normal(len(time))
    arm = ArmDescription("tool_arm", ("z",), LIFT, controller_from(ABOUT), None, Tolerances())
    return ArmRecording(
        name, f"{name}.mcap", "0" * 64, arm, JointSignal(time, read[:, None]),
        JointSignal(time, np.round(goal[:, None] / microstep) * microstep), None,
    )  # fmt: skip


def _residual(recording: ArmRecording) -> float:
    """Standard deviation of what the dynamics leave [N]."""
    (trial,), _ = arm_trials([recording], [])
    return float(np.std(trial.residual["dynamics"]))


def test_a_field_that_is_stamped_early_is_found_and_taken_later() -> None:
    fit, held_out = [lift("a", 1, LATE_S)], [lift("c", 3, LATE_S)]
    fitted, others, notes = with_field_time(fit, held_out)
    for before, after in zip([*fit, *held_out], [*fitted, *others], strict=True):
        assert before.command is not None and after.command is not None
        assert before.command.position is not None and after.command.position is not None
        was, now = before.command.position[:, 0], after.command.position[:, 0]
        speed = np.gradient(was, 1.0 / RATE)
        shift = -np.sum(speed * (now - was)) / np.sum(speed**2)
        assert shift == pytest.approx(LATE_S, abs=0.03e-3)
    off, mended = (_residual(r) for r in (fit[0], fitted[0]))
    assert off > 50.0 and mended < 2.0  # [N]
    assert "+0.1" in notes[0] and "within the 1 ms" in notes[0]


@pytest.mark.parametrize(("late", "reach"), [(0.0, 0.12), (LATE_S, 0.004)])
def test_right_stamps_and_a_slow_field_stay_as_they_are(late: float, reach: float) -> None:
    fit = [lift("a", 1, late, reach)]
    fitted, _, notes = with_field_time(fit, [])
    assert fitted == fit and notes == []


def test_stamps_within_tolerance_are_no_friction() -> None:
    """It won 3,600 of log evidence: the sine of the shift looks like a brake that fades with speed."""
    fitted, _, _ = with_field_time([lift("b", 2, LATE_S)], [])
    won = []
    for recordings in ([lift("b", 2, LATE_S)], fitted):
        evidence = Evidence(Likelihood(arm_trials(recordings, [])[0]))
        won.append(max(evidence.fit([h]).log_evidence for h in evidence.screen([VISCOUS])))
    assert won[0] > 1000.0 and won[1] < 12.0
