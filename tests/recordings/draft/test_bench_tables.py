"""Tables of benches in which columns are no joints, are joints by their path, or whose clock starts anew."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft

TIME = np.arange(0.0, 4.0, 0.01)
ANGLE = 0.6 * np.sin(2.0 * TIME)


def drafted(path: Path, columns: Mapping[str, np.ndarray]) -> Draft:
    np.savetxt(
        path, np.column_stack(list(columns.values())), "%.9g", ",", header=",".join(columns), comments=""
    )
    return draft_any([path], None, None)


def test_an_angle_in_two_units_and_as_it_was_before_is_one_joint(tmp_path: Path) -> None:
    before = np.concatenate([ANGLE[:1], ANGLE[:-1]])
    force = np.cos(2.0 * TIME)
    columns = {
        "time": TIME, "force_feedback": force, "force_desired": 1.1 * force, "force_last_desired": force,
        "position_degrees": np.degrees(ANGLE), "position_radians": ANGLE,
        "position_last": before, "position_last_last": before,
    }  # fmt: skip
    draft = drafted(tmp_path / "sine.csv", columns)
    assert draft.joints == ["joint_1"]
    assert draft.channels["states"]["position"]["unit"] == "deg"
    assert draft.channels["commanded_effort"]["effort"]["formula"] == ["force_desired_1"]
    assert len(draft.questions) == 1 and "in N m" in draft.questions[0]


def test_the_unit_of_an_angle_is_that_of_its_double(tmp_path: Path) -> None:
    columns = {"time": TIME, "theta": ANGLE, "theta_deg": np.degrees(ANGLE)}
    draft = drafted(tmp_path / "beam.csv", columns)
    assert draft.sources["states"]["columns"] == {"theta_deg_1": "theta_deg"}
    assert not [question for question in draft.questions if "states.position" in question]


def test_joints_stand_in_paths_and_those_of_zeros_are_asked_for(tmp_path: Path) -> None:
    columns: dict[str, np.ndarray] = {"__time": 1.7e9 + TIME}
    for name, angle in {
        "roll": 40.0 * ANGLE,
        "pitch": 9.0 * np.cos(TIME),
        "servo1": 0.0 * TIME,
        "servo2": 0.0 * TIME,
    }.items():
        columns[f"/telemetry/{name}/effort"] = 1.02 * angle  # what that node publishes: the set point
        columns[f"/telemetry/{name}/position"] = angle
    draft = drafted(tmp_path / "roll.csv", columns)
    assert draft.joints == ["roll", "pitch", "servo1", "servo2"]
    asked = " ".join(draft.questions)
    assert "servo1, servo2 are zero throughout" in asked
    assert "or a set point, as it lies on the position" in asked


def test_a_clock_that_starts_anew_cuts_runs(tmp_path: Path) -> None:
    time = np.concatenate([TIME, 0.005 + TIME[:-40]])
    angle = np.concatenate([ANGLE, 1.0 + ANGLE[:-40]])
    draft = drafted(
        tmp_path / "motor.csv", {"pi_time": time, "position": angle, "torque": np.cos(3.0 * time)}
    )
    assert [each.get("rows") for each in draft.recordings] == [[0, 400], [400, 760]]
    assert [each["role"] for each in draft.recordings] == ["fit", "held_out"]
    assert any("2 runs of one machine" in question for question in draft.questions)


def test_many_short_runs_are_asked_for(tmp_path: Path) -> None:
    time = np.concatenate([TIME[:50] + 0.1 * k for k in (0, 3, 1, 4, 2, 5)])
    angle = np.sin(np.arange(300.0) / 20.0)
    draft = drafted(tmp_path / "motor.csv", {"time": time, "position_rad": angle, "tau_Nm": angle})
    assert len(draft.recordings) == 1
    assert any("Put each into a table of its own" in question for question in draft.questions)


def test_columns_that_say_nothing_are_refused_with_what_to_write(tmp_path: Path) -> None:
    columns = {f"Channel {k}": np.sin(TIME * k) for k in (1, 2, 3)}
    with pytest.raises(
        InputError, match=r"among data.csv: Channel 1.*say in the first line what columns hold"
    ):
        drafted(tmp_path / "data.csv", columns)
