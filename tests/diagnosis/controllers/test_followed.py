"""A servo of which nothing is logged but where it was: its law and model say how far it gives way.

Every SO-100 at 30 Hz had its weight as a "controller gain", though law and masses were described and right.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.importer import ImportedRecording

MASS, LENGTH, G, STIFFNESS, DAMPING, ROTOR = 0.4, 0.2, 9.81, 12.0, 0.8, 0.02
RATE_HZ, STEP_S = 30.0, 0.001
URDF = (
    '<robot name="p"><link name="base"/><link name="rod"><inertial>'
    f'<origin xyz="{LENGTH} 0 0"/><mass value="{MASS}"/><inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6"'
    ' iyz="0" izz="1e-6"/></inertial></link><joint name="lift" type="revolute"><parent link="base"/>'
    '<child link="rod"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="5" velocity="5"/></joint>'
    "</robot>"
)


def log(path: Path, described: bool, fed: bool = False) -> Trial:
    """20 s of a servo that holds each goal, in degrees, at 30 Hz.

    `fed`: it follows lines between them, and damps against their speed.
    """
    time = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
    goal = 0.6 * np.sin(0.9 * time) + 0.3 * np.sin(2.3 * time)
    slope = np.gradient(goal, time)
    per, q, v, went = 1.0 / (RATE_HZ * STEP_S), goal[0], 0.0, []
    inertia = MASS * LENGTH**2 + 1e-6 + ROTOR
    for k in range(int(20.0 / STEP_S)):
        at = int((k + 1e-6) / per)
        if len(went) <= at:
            went.append(q)
        target, rate = (np.interp(k * STEP_S, time, x) for x in (goal, slope)) if fed else (goal[at], 0.0)
        torque = STIFFNESS * (target - q) + DAMPING * (rate - v) + MASS * G * LENGTH * np.cos(q)
        v += STEP_S * torque / inertia
        q += STEP_S * v
    rows = np.column_stack([time, np.degrees(goal), np.degrees(went)])
    np.savetxt(path / "a.csv", rows, delimiter=",", header="t,goal,q", comments="", fmt="%.6f")
    (path / "arm.urdf").write_text(URDF)
    mapping = {
        "joints": ["lift"],
        "urdf": "arm.urdf",
        "sources": {"log": {"file": "a.csv", "time": {"column": "t"}, "columns": {"g": "goal", "q": "q"}}},
        "channels": {
            "states": {"position": {"formula": ["q"], "unit": "deg"}, "velocity": "derivative"},
            "command": {"position": {"formula": ["g"], "unit": "deg"}},
        },
        "recordings": [{"name": "one"}],
    }
    if described:
        mapping["controller"] = {
            "type": "position_servo", "stiffness": [STIFFNESS], "damping": [DAMPING], "armature": [ROTOR],
            "between_commands": "line" if fed else "held", "period_s": STEP_S,
            "velocity_feedforward": [float(fed)],
        }  # fmt: skip
    (path / "m.yaml").write_text(yaml.safe_dump(mapping))
    (made,) = import_any(path / "m.yaml", path, None).made
    assert isinstance(made, ImportedRecording)
    return Trial(made.recording, RigidArm(made.recording.arm))


def test_a_described_servo_leaves_nothing(tmp_path: Path) -> None:
    trial = log(tmp_path, True)
    assert trial.channels == ("tracking",)
    assert (
        np.sqrt(np.mean(trial.residual["tracking"] ** 2)) < 0.002
    )  # [rad] of a weight of 0.065 over the stiffness


def test_a_speed_that_a_law_is_fed_and_nobody_logged_is_that_of_the_goals(tmp_path: Path) -> None:
    """A telescope's drives, exactly as described, had a gap: the servo was not fed what the note said."""
    assert np.sqrt(np.mean(log(tmp_path, True, fed=True).residual["tracking"] ** 2)) < 0.004  # 0.04 without


def test_without_a_law_the_command_is_the_answer(tmp_path: Path) -> None:
    left = log(tmp_path, False).residual["tracking"]
    assert np.sqrt(np.mean(left**2)) == pytest.approx(MASS * G * LENGTH / STIFFNESS, rel=0.4)
