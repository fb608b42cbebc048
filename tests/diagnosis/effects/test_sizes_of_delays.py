"""Delays as long as they are, where a log lacks half of its rows, and where goals are held between rows."""

from __future__ import annotations

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import ArmDescription, Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.cell.types.controllers import controller_from
from samrl_core.diagnosis.effects.drive.command_delay import EFFECT as DELAY
from samrl_core.diagnosis.kinds.arms import arm_trials
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import ParameterEstimate
from samrl_core.diagnosis.selection.hypothesis import Evidence
from samrl_core.diagnosis.selection.search import search_shapes
from samrl_core.diagnosis.verdict.confidence import estimates

INERTIA, LOST, TICK = 0.004, 0.03, 0.001  # [kg m2], [N m s/rad], [s] of the controller
SOFT, STIFF = (9.0, 0.35), (400.0, 1.8)  # [N m/rad], [N m s/rad]
ARM = f"""<robot name="turn"><link name="base"/><link name="disc"><inertial><mass value="0.2"/>
<inertia ixx="0.001" iyy="0.001" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="z" type="revolute"><parent link="base"/><child link="disc"/><axis xyz="0 0 1"/>
<dynamics damping="{LOST}"/><limit lower="-3" upper="3" effort="4" velocity="12"/></joint></robot>"""


def turned(
    late: float, goal_s: float, rows: np.ndarray, seed: int, law: tuple[float, float] = SOFT
) -> ArmRecording:
    """A disc behind a spring and a damper.

    Args:
        late: from a goal's stamp to when the controller has it [s].
        goal_s: for so long each goal is held; one of the controller's ticks for those that are not.
        rows: ticks that are logged.
        seed: of goals and noise.
        law: stiffness and damping; goals' speeds are logged beside a stiff one, which is else one that damps
            against zero, with less delay.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(rows[-1] + 1) * TICK
    phases, sizes = rng.uniform(0, 6, 5), rng.normal(size=5)
    turns = 2 * np.pi * 0.3 * np.arange(1, 6)
    held = goal_s > TICK

    def goals(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = np.maximum(np.floor(at / goal_s + 1e-6) * goal_s if held else at, 0.0)
        waves = turns * at[:, None] + phases
        position, speed = np.sin(waves) @ sizes, np.cos(waves) @ (turns * sizes)
        size = 1.2 / np.sum(np.abs(sizes))
        return size * position, 0.0 * speed if held else size * speed

    stiffness, damping = law
    wanted, rate = goals(time - late)
    angle, speed = float(wanted[0]), float(rate[0])
    q, dq, torque = [], [], []
    for goal, fast in zip(wanted.tolist(), rate.tolist(), strict=True):
        asked = stiffness * (goal - angle) + damping * (fast - speed)
        q.append(angle)
        dq.append(speed)
        torque.append(asked)
        for _ in range(4):
            speed += TICK / 4 * (asked - LOST * speed) / INERTIA
            angle += TICK / 4 * speed
    gains = {"stiffness": [stiffness], "damping": [damping]}
    about = {
        "type": "joint_impedance",
        "joints": ["z"],
        **gains,
        "gravity_compensation": False,
        "period_s": TICK,
    }
    about |= {"between_commands": "held"} if held else {}
    arm = ArmDescription("tool_arm", ("z",), ARM, controller_from(about), None, Tolerances())
    noise = rng.standard_normal((3, len(rows)))
    read = np.array(q)[rows] + 1e-4 * noise[0]
    moved = np.array(dq)[rows] + 0.01 * noise[1]
    sent = np.array(torque)[rows] + 0.002 * noise[2]
    stamps = time[rows]
    told, fast = (each[rows, None] for each in goals(time))
    command = JointSignal(stamps, np.round(told, 4), fast if law is STIFF else None)
    return ArmRecording(
        f"turn {seed}", f"turn{seed}.mcap", "0" * 64, arm,
        JointSignal(stamps, read[:, None], moved[:, None]), command,
        JointSignal(stamps, effort=sent[:, None]),
    )  # fmt: skip


def size_of_delay(recording: ArmRecording) -> ParameterEstimate:
    trials, _ = arm_trials([recording], [])
    evidence = Evidence(Likelihood(trials))
    best = max((evidence.fit([h]) for h in evidence.screen([DELAY])), key=lambda fit: fit.log_evidence)
    fit = search_shapes(evidence, best, 30, 2)
    return estimates(evidence, fit, 0, np.random.default_rng(0))["T"]


@pytest.mark.parametrize(("late", "beyond"), [(0.0175, 0.0002), (0.005, 0.0007)])
def test_a_delay_is_as_long_as_it_is_in_a_log_that_lacks_half_of_its_rows(late: float, beyond: float) -> None:
    """They were 18.3 and 6.4 ms: late by other rows, and with the speed of rounded goals, it was noisy.

    What stamps may be off by, 0.5 ms, is part of a short one.
    """
    rows = np.flatnonzero(np.random.default_rng(3).uniform(size=4000) < 0.5)
    found = size_of_delay(turned(late, TICK, rows, 1))
    assert found.value == pytest.approx(late, abs=beyond)
    assert found.ci95[0] <= late <= found.ci95[1]


@pytest.mark.parametrize("late", [0.0129, 0.0171])
def test_a_delay_of_held_goals_is_known_to_the_time_of_one(late: float) -> None:
    """It was 20.0 +- 2.2 ms: where one row has each goal, what comes late is the goal before the last."""
    found = size_of_delay(turned(late, 0.01, np.arange(0, 3000, 10), 1))
    assert found.value == pytest.approx(0.015, abs=0.0002)
    assert 0.010 < found.ci95[0] <= late <= found.ci95[1] < 0.021


def test_rows_between_held_goals_tell_a_delay_as_finely_as_they_lie() -> None:
    found = size_of_delay(turned(0.0129, 0.01, np.arange(0, 3000, 5), 1))
    assert found.value == pytest.approx(0.0125, abs=0.0002)


def test_a_stiff_loop_that_would_be_cut_had_it_the_goal_at_once_is_as_late_as_it_is() -> None:
    """It asks for six times what its drive gives: that beyond the limit was in the column alone."""
    found = size_of_delay(turned(0.022, TICK, np.arange(3000), 1, STIFF))
    assert found.value == pytest.approx(0.022, abs=0.0002)
    assert found.ci95[0] <= 0.022 <= found.ci95[1]
