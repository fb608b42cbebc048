"""A law that feeds the commanded velocity forward, in a log that holds none: it is the goals' own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.types.arm_description import HELD
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.cell.types.controllers.servos import PositionServo
from samrl_core.diagnosis.kinds.arms import Arms
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from tests.diagnosis.controllers.late_speeds import DAMPING, JOINT, PERIOD_S, ROTOR, STIFFNESS, record, swing


def without_speed(share: float | None) -> ArmRecording:
    """The pendulum's log without its commanded velocity, its loop described with a share of that or none."""
    made = record(swing(damps_reported=False))
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
