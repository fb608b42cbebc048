"""A servo that keeps each goal until the next one, and one that follows a line between them: NumPy alone."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import HELD, LINE, ArmDescription
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import KINDS
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.kinds.arms import Arms
from samrl_core.diagnosis.residuals.signals.signal_band import held_on_grid
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.result import Diagnosis
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

URDF = """<robot name="swing"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.2"/>
<mass value="1.0"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 -1 0"/>
<limit lower="-6.3" upper="6.3" effort="20" velocity="10"/><dynamics damping="0.05" friction="0.05"/></joint>
</robot>"""
MASS, LENGTH, INERTIA, DAMPING, FRICTION = 1.0, 0.2, 1e-3 + 0.04, 0.05, 0.05
STIFFNESS, BRAKE, ROTOR = 12.0, 0.5, 0.01
STEP_S, COUNTS, SECONDS = 0.0005, 4096, 12.0


def goal_at(time: np.ndarray, seed: int) -> np.ndarray:
    """A sum of five sines up to 2.5 Hz [rad]."""
    rng = np.random.default_rng(seed)
    hertz, phase = rng.uniform(0.2, 2.5, 5), rng.uniform(0.0, 2.0 * np.pi, 5)
    waves = [np.sin(2.0 * np.pi * f * time + p) / (0.6 + f) for f, p in zip(hertz, phase, strict=True)]
    return 0.5 * np.sum(waves, axis=0)


@cache
def recording(goal_hz: float, log_hz: float, held: bool, late_s: float, seed: int) -> ArmRecording:
    """The servo under goals at their rate, logged at another; `late_s` before a goal arrives."""
    count = round(SECONDS / STEP_S)
    time = np.arange(count) * STEP_S
    stamps = np.arange(0.0, SECONDS, 1.0 / goal_hz)
    goals = goal_at(stamps, seed)
    arrived = time - late_s
    if held:
        followed = goals[np.clip(np.searchsorted(stamps, arrived + 1e-9, side="right") - 1, 0, None)]
    else:
        followed = np.interp(arrived, stamps, goals)
    q, v = float(goals[0]), 0.0
    at, speed = np.empty(count), np.empty(count)
    for k in range(count):
        at[k], speed[k] = q, v
        torque = STIFFNESS * (followed[k] - q) - BRAKE * v - MASS * 9.81 * LENGTH * np.sin(q)
        torque -= DAMPING * v + FRICTION * np.tanh(v / 0.01)
        v += STEP_S * torque / (INERTIA + ROTOR)
        q += STEP_S * v
    every = round(1.0 / (log_hz * STEP_S))
    some = slice(round(1.0 / STEP_S), None, every)  # after it has settled
    step = 2.0 * np.pi / COUNTS
    position = np.round(at[some] / step) * step
    noisy = speed[some] + 0.01 * np.random.default_rng([seed, 1]).standard_normal(len(position))
    law = {"stiffness": [STIFFNESS], "damping": [BRAKE], "armature": [ROTOR]}
    about = {"type": "position_servo", "joints": ["swing"], **law, "between_commands": HELD if held else LINE}
    controller = KINDS["position_servo"].read(about, ("swing",), "test")
    arm = ArmDescription("tool_arm", ("swing",), URDF, controller)
    states = JointSignal(time[some], position[:, None], noisy[:, None])
    command = JointSignal(stamps, goals[:, None])
    return ArmRecording(f"run {seed}", f"run{seed}", "", arm, states, command, None)


def diagnosed(goal_hz: float, log_hz: float, held: bool, late_s: float = 0.0) -> Diagnosis:
    """What is said of three recordings, the last of them held out."""
    runs = [recording(goal_hz, log_hz, held, late_s, seed) for seed in range(3)]
    return diagnose(runs[:2], runs[2:])[0]


def test_what_a_law_asked_for_is_known_without_a_recorded_torque() -> None:
    """It was looked up while the law's own command was being made, and stayed unknown: a traceback."""
    made = recording(30.0, 100.0, True, 0.0, 0)
    motion = Trial(made, RigidArm(made.arm)).motion
    assert motion.computed and motion.asked is not None


@pytest.mark.parametrize(
    ("goal_hz", "log_hz"),
    [
        pytest.param(100.0, 100.0, marks=pytest.mark.slow),
        pytest.param(50.0, 200.0, marks=pytest.mark.slow),
        pytest.param(30.0, 100.0, marks=pytest.mark.thorough),
    ],
)
@pytest.mark.parametrize("held", [True, False])
def test_nothing_is_wrong_with_a_servo_as_described(goal_hz: float, log_hz: float, held: bool) -> None:
    found = diagnosed(goal_hz, log_hz, held)
    assert found.verdict == "no_gap", (found.effects, found.reasons)


@pytest.mark.slow
@pytest.mark.parametrize(("goal_hz", "log_hz"), [(100.0, 100.0), (50.0, 200.0)])
def test_goals_that_are_held_and_late_too_are_called_late(goal_hz: float, log_hz: float) -> None:
    found = diagnosed(goal_hz, log_hz, True, 0.03)
    named = {e.family: e for e in found.effects}
    assert found.verdict == "effect" and set(named) == {"command_delay"}, (found.effects, found.reasons)
    low, high = named["command_delay"].parameters["T"].ci95
    assert low <= 0.03 <= high and high - low < 0.01


def test_a_held_signal_is_its_mean_over_a_step_or_its_value_at_the_instant() -> None:
    stamps, values = np.array([0.0, 0.1, 0.2, 0.3]), np.array([[1.0], [3.0], [3.0], [-1.0]])
    grid = np.arange(5) * 0.1
    at = held_on_grid(stamps, values, grid, mean=False)
    mean = held_on_grid(stamps, values, grid, mean=True)
    assert at is not None and mean is not None
    assert at[:, 0].tolist() == [1.0, 3.0, 3.0, -1.0, -1.0]
    assert mean[:, 0] == pytest.approx([1.0, 2.0, 3.0, 1.0, -1.0])
    wandering = held_on_grid(np.array([0.0, 0.02, 0.25, 0.3]), values, grid, mean=True)
    assert wandering is not None
    assert wandering[:, 0] == pytest.approx([1.6, 3.0, 3.0, 1.0, -1.0])


def test_a_bag_carries_it_and_another_word_is_refused() -> None:
    from samrl_core.common.errors import InputError
    from samrl_ros.recordings.nominal_texts import controller_text, parse_controller

    arm = recording(100.0, 100.0, True, 0.0, 0).arm
    text = controller_text(arm)
    read = parse_controller(text, "a bag").controller
    assert read is not None and read.between_commands == HELD
    with pytest.raises(InputError, match="between_commands is 'kept', must be one of line, held"):
        parse_controller(text.replace('"held"', '"kept"'), "a bag")


@pytest.mark.parametrize(("held", "told"), [(True, False), (False, True)], ids=["stated", "left out"])
def test_what_is_followed_between_two_goals_is_asked(held: bool, told: bool) -> None:
    """A leg's data set does not say whether goals are held, and nothing asked."""
    fitted, _ = Arms().trials([recording(100.0, 100.0, held, 0.0, 0)], [])
    notes = Arms().notes(fitted)
    assert [("every 10 ms" in n and "5 ms of delay" in n) for n in notes] == ([True] if told else [])
