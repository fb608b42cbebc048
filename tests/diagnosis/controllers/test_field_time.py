"""A stepper's field turns a radian while stamps are off by 0.2 ms: no straight line, and no friction."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import controller_from
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.residuals.field_time import with_field_time

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


def lift(name: str, seed: int, late: float, reach: float = 0.12, seconds: float = 5.0) -> ArmRecording:
    """A carriage on sines of up to 2.1 Hz, and microsteps that move it so, stamped too early by `late`."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(seconds * RATE)) / RATE
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


def test_a_field_that_is_stamped_early_is_found_and_taken_later() -> None:
    """Within what is in proportion: friction bends nothing either, and is known less well."""
    fit, held_out = [lift("a", 1, LATE_S)], [lift("c", 3, LATE_S)]
    fitted, others, notes = with_field_time(fit, held_out)
    for before, after in zip([*fit, *held_out], [*fitted, *others], strict=True):
        assert before.command is not None and after.command is not None
        shift = after.command.time - before.command.time
        np.testing.assert_allclose(shift, LATE_S, atol=0.05e-3)
    assert "+0.1" in notes[0] and "within the 1 ms" in notes[0]


@pytest.mark.parametrize(("late", "reach"), [(0.0, 0.12), (LATE_S, 0.004)])
def test_right_stamps_and_a_slow_field_stay_as_they_are(late: float, reach: float) -> None:
    fit = [lift("a", 1, late, reach)]
    fitted, _, notes = with_field_time(fit, [])
    assert fitted == fit and notes == []


@pytest.mark.thorough
def test_stamps_within_tolerance_are_no_gap() -> None:
    """It was `none_of_mine`, nearest friction that fades with speed, as a sine of the shift looks."""
    recordings = [lift(name, seed, LATE_S, seconds=8.0) for name, seed in (("a", 1), ("b", 2), ("c", 3))]
    found = diagnose(recordings[:-1], recordings[-1:], DiagnosisSettings())[0]
    assert found.verdict == "no_gap", found.reasons
