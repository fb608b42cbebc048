"""A law that feeds the commanded velocity forward, in a log that holds none: it is the goals' own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.cell.types.arm_description import HELD, LINE
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.cell.types.controllers.impedance import JointImpedance
from samrl_core.cell.types.controllers.servos import PositionServo, VelocityDrive
from samrl_core.diagnosis.kinds.arms import Arms
from samrl_core.diagnosis.residuals.laws.commanded_speed import damps_against_goals
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.late_speeds import DAMPING, JOINT, PERIOD_S, ROTOR, STIFFNESS, record, swing


@cache
def logged() -> ArmRecording:
    """The pendulum's log; its driver reports velocities late."""
    return record(swing(damps_reported=False))


def without_speed(share: float | None) -> ArmRecording:
    """The pendulum's log without its commanded velocity, its loop described with a share of that or none."""
    made = logged()
    about = {
        "type": "position_servo", "joints": [JOINT], "stiffness": [STIFFNESS], "damping": [DAMPING],
        "period_s": PERIOD_S, "armature": [ROTOR],
    }  # fmt: skip
    if share is not None:
        about["velocity_feedforward"] = [share]
    arm = replace(made.arm, controller=PositionServo().read(about, (JOINT,), "controller"))
    assert made.command is not None
    states = replace(made.states, velocity=None)  # which the driver reports late
    return replace(made, arm=arm, states=states, command=replace(made.command, velocity=None))


def unexplained(recording: ArmRecording) -> float:
    """Of the recorded torque, by the law [N m]."""
    trial = Trial(recording, RigidArm(recording.arm))
    return float(np.sqrt(np.mean(trial.residual["controller"] ** 2)))


def test_the_goals_speed_is_fed_forward() -> None:
    assert unexplained(without_speed(1.0)) < 0.05
    assert unexplained(without_speed(0.0)) > 1.0
    assert unexplained(without_speed(None)) > 1.0


def test_a_velocity_drive_feeds_its_default_share() -> None:
    """Its reference says 1; without the key the law damped against a standstill: 20 N m off at a wrist."""
    made = without_speed(None)
    about = {
        "type": "velocity_drive", "joints": [JOINT], "velocity_gain": [DAMPING],
        "position_gain": [STIFFNESS / DAMPING], "period_s": PERIOD_S, "armature": [ROTOR],
    }  # fmt: skip
    for share, least, most in ((None, 0.0, 0.05), (0.0, 1.0, np.inf)):
        stated = about if share is None else about | {"velocity_feedforward": [share]}
        arm = replace(made.arm, controller=VelocityDrive().read(stated, (JOINT,), "controller"))
        assert least <= unexplained(replace(made, arm=arm)) < most


@pytest.mark.parametrize("against_goals", [True, False])
def test_the_torque_tells_whether_an_impedance_damps_against_its_goals(against_goals: bool) -> None:
    """`D (dq_d - dq)` with positions alone was read as damping against zero: a gain was named."""
    made, full = without_speed(None), logged()
    assert full.command is not None and full.command.velocity is not None
    sent = full.commanded_effort
    assert sent is not None and sent.effort is not None
    if not against_goals:
        fed = np.interp(sent.time, full.command.time, full.command.velocity[:, 0])[:, None]
        made = replace(made, commanded_effort=replace(sent, effort=sent.effort - DAMPING * fed))
    about = {
        "joints": [JOINT], "stiffness": [STIFFNESS], "damping": [DAMPING], "gravity_compensation": False,
        "period_s": PERIOD_S, "armature": [ROTOR],
    }  # fmt: skip
    arm = replace(made.arm, controller=JointImpedance().read(about, (JOINT,), "controller"))
    trial = Trial(replace(made, arm=arm), RigidArm(arm))
    assert damps_against_goals(trial.motion) == against_goals
    assert np.sqrt(np.mean(trial.residual["controller"] ** 2)) < 0.06
    told = [note for note in Arms().notes([trial]) if "damps against the speed" in note]
    assert len(told) == against_goals


@pytest.mark.parametrize("against_goals", [True, False])
def test_a_late_command_hides_not_what_the_law_damps_against(against_goals: bool) -> None:
    """Late by 0.45 D / K, the speed of goals looked like damping against zero: half the damping was named."""
    made, full, late = without_speed(None), logged(), 0.45 * DAMPING / STIFFNESS
    assert full.command is not None and full.command.position is not None
    assert full.command.velocity is not None
    sent, command = full.commanded_effort, full.command
    assert sent is not None and sent.effort is not None

    def of_command(time: np.ndarray, share: float) -> np.ndarray:
        q, dq = (np.interp(time, command.time, x[:, 0]) for x in (command.position, command.velocity))
        return (STIFFNESS * q + share * DAMPING * dq)[:, None]

    effort = sent.effort - of_command(sent.time, 1.0) + of_command(sent.time - late, float(against_goals))
    about = {
        "joints": [JOINT], "stiffness": [STIFFNESS], "damping": [DAMPING], "gravity_compensation": False,
        "period_s": PERIOD_S, "armature": [ROTOR],
    }  # fmt: skip
    arm = replace(made.arm, controller=JointImpedance().read(about, (JOINT,), "controller"))
    made = replace(made, arm=arm, commanded_effort=replace(sent, effort=effort))
    assert damps_against_goals(Trial(made, RigidArm(arm)).motion) == against_goals


def test_it_is_said() -> None:
    kind = Arms()
    (told,) = [
        note
        for note in kind.notes(kind.trials([without_speed(1.0)], [])[0])
        if "velocity_feedforward: 0" in note
    ]
    assert "derivative" in told
    assert not any("feeds" in n for n in kind.notes(kind.trials([without_speed(None)], [])[0]))


def test_held_goals_have_no_speed() -> None:
    made = without_speed(1.0)
    assert made.arm.controller is not None
    held = replace(made.arm.controller, between_commands=HELD)
    assert unexplained(replace(made, arm=replace(made.arm, controller=held))) > 1.0


@pytest.mark.parametrize(("share", "between", "said"), [(1.0, HELD, 1), (0.0, HELD, 0), (1.0, LINE, 0)])
def test_a_speed_that_counts_as_zero_is_said(share: float, between: str, said: int) -> None:
    """A law with a feed-forward and held goals had no gap, 9.5 tolerances off, and nothing was said of it."""
    made = without_speed(share)
    assert made.arm.controller is not None
    arm = replace(made.arm, controller=replace(made.arm.controller, between_commands=between))
    trial = Trial(replace(made, arm=arm), RigidArm(arm))
    assert sum("counts as zero" in n and "velocity: derivative" in n for n in Arms().notes([trial])) == said
