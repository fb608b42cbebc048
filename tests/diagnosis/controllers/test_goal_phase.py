"""A torque that is read right before the next goal, where a stiff servo gives least: no friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import controller_from
from samrl_core.diagnosis.effects.friction.viscous_friction import EFFECT as VISCOUS
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.laws.goal_phase import reading_time
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence

INERTIA, LOST, STIFFNESS = 0.012, 0.9, 19.0  # [kg m2], [N m s/rad] to speed, [N m/rad]
GOAL_S, COUNT = 0.01, 2 * np.pi / 4096
ARM = f"""<robot name="turn"><link name="base"/><link name="disc"><inertial><mass value="0.2"/>
<inertia ixx="0.001" iyy="0.001" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="z" type="revolute"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
<dynamics damping="{LOST}"/><limit lower="-3" upper="3" effort="4" velocity="5"/></joint></robot>"""
ABOUT = {
    "type": "position_servo", "joints": ["z"], "stiffness": [STIFFNESS], "damping": [0.0],
    "between_commands": "held", "period_s": 0.001,
}  # fmt: skip


def servo(seed: int, read_at: float, more: float = 0.0, swaps: float = 0.0) -> ArmRecording:
    """A disc behind a servo, at 1 kHz, that is told a goal every 10 ms.

    Args:
        seed: of goals and noise.
        read_at: share of a goal's time that has passed when the host reads.
        more: friction [N m s/rad] that the model lacks.
        swaps: share of rows that are read 2 ms later, after the next goal came, and hold the old one.
    """
    rng, seconds, per = np.random.default_rng(seed), 20.0, 10
    time = np.arange(int(seconds / GOAL_S)) * GOAL_S
    sizes, phases = rng.normal(size=5), rng.uniform(0, 6, 5)
    turn = 2 * np.pi * 0.09 * np.arange(1, 6)
    goals = 1.2 * np.sin(turn * time[:, None] + phases) @ sizes / np.sum(np.abs(sizes))
    goals = np.round(goals / COUNT) * COUNT
    angle, speed, steps = goals[0], 0.0, 10
    q, torque = [], []
    for goal in goals.tolist():
        for _ in range(per):
            asked = STIFFNESS * (goal - angle)
            for _ in range(steps):
                speed += 1e-3 / steps * (asked - (LOST + more) * speed) / INERTIA
                angle += 1e-3 / steps * speed
            q.append(angle)
            torque.append(asked)
    late = np.where(rng.uniform(size=len(time)) < swaps, 2, 0)
    at = np.minimum(np.arange(len(time)) * per + round(read_at * per) + late, len(q) - 1)
    stamps = at * 1e-3
    # Stamped when it was read, with the goal that the host has sent last.
    read = np.round(np.array(q)[at - 1] / COUNT) * COUNT
    current = np.array(torque)[at] + 0.004 * rng.standard_normal(len(at))
    arm = ArmDescription("tool_arm", ("z",), ARM, controller_from(ABOUT), None, Tolerances())
    return ArmRecording(
        "turn", "turn.mcap", "0" * 64, arm, JointSignal(stamps, read[:, None]),
        JointSignal(stamps, goals[:, None]), JointSignal(stamps, effort=current[:, None]),
    )  # fmt: skip


def won_by_friction(recording: ArmRecording) -> float:
    evidence = Evidence(Likelihood(arm_trials([recording], [])[0]))
    return max(evidence.fit([h]).log_evidence for h in evidence.screen([VISCOUS]))


@pytest.mark.parametrize(("read_at", "swaps"), [(0.9, 0.0), (0.1, 0.0), (0.9, 0.2)])
def test_a_torque_that_is_read_at_one_place_of_the_tooth_is_no_friction(read_at: float, swaps: float) -> None:
    """Read right before the next goal it won 6,775 of log evidence: the motion feels the mean."""
    assert won_by_friction(servo(1, read_at, swaps=swaps)) < 12.0


def test_friction_beyond_the_tooth_is_seen() -> None:
    assert won_by_friction(servo(1, 0.9, more=0.8)) > 12.0


def test_only_held_goals_have_teeth() -> None:
    recording = servo(1, 0.9)
    assert recording.arm.controller is not None

    def time_of(**changes: object) -> float:
        about = ABOUT | changes
        arm = replace(recording.arm, controller=controller_from(about))
        (trial,), _ = arm_trials([replace(recording, arm=arm)], [])
        return reading_time(trial.motion)

    assert time_of() == pytest.approx(0.5 * GOAL_S, rel=0.01)
    assert time_of(between_commands="line") == 0.0
    assert time_of(period_s=GOAL_S) == 0.0  # it holds its torque as long
