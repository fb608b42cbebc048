"""Logs as labs publish them: ABB's EGM, Kinova's feedback, a drive's scope, runs in two folders each."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.column_names import is_time, meaning
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.arm_messages import is_unitree
from samrl_ros.log_import.tables import read_table

TIME = np.arange(0.0, 4.0, 0.01)
ANGLES = np.column_stack([np.sin(TIME), np.cos(1.3 * TIME)])


def table(path: Path, names: list[str], columns: list[np.ndarray], above: str = "") -> Path:
    rows = [",".join(f"{x:.5f}" for x in row) for row in np.column_stack(columns)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(above + "\n".join([",".join(names), *rows]) + "\n")
    return path


def positions(draft: Draft) -> list[str]:
    columns = draft.sources["states"]["columns"]
    return [columns[name] for name in draft.channels["states"]["position"]["formula"]]


def test_a_switch_that_never_changes_is_no_position(tmp_path: Path) -> None:
    names = ["seqno", "tm", "feedBack.joints.1", "feedBack.joints.2", "planned.joints.1", "planned.joints.2"]
    degrees = 40.0 * ANGLES
    columns = [np.arange(len(TIME)), 1e3 * TIME, *degrees.T, *np.roll(degrees, 2, axis=0).T]
    still = np.full(len(TIME), 2.0)
    path = table(tmp_path / "egm.csv", [*names, "motorState", "mciState"], [*columns, still, still])
    draft = draft_any([path], None, None)
    assert positions(draft) == ["feedBack.joints.1", "feedBack.joints.2"]
    assert list(draft.channels["command"]["position"]["formula"]) == ["planned_joints_1", "planned_joints_2"]
    assert draft.sources["states"]["time"] == {"column": "tm", "unit": "ms"}


@pytest.mark.parametrize("stem", ["motor_state[{}].q", "motor_state.{}.dq", "motorState_{}_tau_est"])
def test_a_field_of_a_motor_is_unitrees_and_a_motors_state_is_not(stem: str) -> None:
    assert is_unitree(stem)
    assert not is_unitree("motorState") and not is_unitree("motor_state_machine")


def test_a_sample_may_hold_as_many_objects_each_time(tmp_path: Path) -> None:
    samples = [
        {"t": t, "actuators": [{"position": a, "torque": 2.0 * a}, {"position": b, "torque": -b}]}
        for t, (a, b) in zip(TIME.tolist(), ANGLES.tolist(), strict=True)
    ]
    path = tmp_path / "feedback.jsonl"
    path.write_text("\n".join(map(json.dumps, samples)))
    read = read_table(path, "", "log").columns
    assert read["actuators.1.torque"] == pytest.approx(-ANGLES[:, 1])
    assert positions(draft_any([path], None, None)) == ["actuators.0.position", "actuators.1.position"]
    del samples[5]["actuators"][1]  # what is seen now and then has no column of its own
    path.write_text("\n".join(map(json.dumps, samples)))
    assert set(read_table(path, "", "log").columns) == {"t"}


def test_a_slides_loop_is_in_its_own_unit(tmp_path: Path) -> None:
    names = ["Time (ms)", "PL.CMD (mm)", "PL.FB (mm)", "VL.FB (mm/s)", "IL.FB (Arms)"]
    place = 50.0 * np.sin(TIME)
    columns = [1e3 * TIME, place, np.roll(place, 1), np.gradient(np.roll(place, 1), TIME), np.cos(TIME)]
    draft = draft_any([table(tmp_path / "scope.csv", names, columns, "Scope Export\n\n")], None, None)
    assert positions(draft) == ["PL.FB (mm)"]
    assert draft.channels["states"]["position"]["unit"] == "mm"
    assert meaning("IL.FB (Arms)").quantity == "current"


def test_a_slides_speed_alone_is_no_motors(tmp_path: Path) -> None:
    speed = 150.0 * np.cos(TIME)
    draft = draft_any([table(tmp_path / "v.csv", ["time", "speed (mm/s)"], [TIME, speed])], None, None)
    assert draft.channels["states"]["velocity"]["unit"] == "mm/s"
    assert draft.channels["states"]["position"]["unit"] == "mm"


@pytest.mark.parametrize("each", [False, True])
def test_runs_may_lie_two_folders_deep_beside_what_describes_them(tmp_path: Path, each: bool) -> None:
    for name in ("a", "b"):
        folder = tmp_path / name / "recording"
        folder.mkdir(parents=True)
        np.savez(folder / "measured.npz", time_s=TIME, q_rad=ANGLES)
        (folder / "recording.json").write_text(json.dumps({"arrays": {"q_rad": {"shape": [400, 2]}}}))
    given = [tmp_path / name / "recording" for name in ("a", "b")] if each else [tmp_path]
    draft = draft_any(given, None, None)
    assert [(r["name"], r["role"]) for r in draft.recordings] == [("a", "fit"), ("b", "held_out")]
    assert draft.sources["states"]["file"] == "{name}/recording/measured.npz"


def test_a_torque_that_is_held_for_ten_rows_is_not_used(tmp_path: Path) -> None:
    """A Panda's sensors at 100 Hz in the rows of a controller at 1 kHz: late by 4.5 ms, and in steps."""
    torque = 3.0 * np.cos(TIME)
    held = torque[np.arange(len(TIME)) // 10 * 10]
    for name, values in (("fresh", torque), ("held", held), ("coarse", np.round(torque, 1))):
        names = ["time_s", "q1_rad", "q2_rad", "tau1_Nm", "tau2_Nm"]
        path = table(tmp_path / f"{name}.csv", names, [TIME, *ANGLES.T, values, -values])
        draft = draft_any([path], None, None)
        assert ("commanded_effort" in draft.channels) == (name != "held")
        assert any("held for 10 rows" in line for line in draft.unused) == (name == "held")


def test_words_of_these_logs() -> None:
    assert is_time("tm") and meaning("feedBack.joints.1").measured and meaning("planned.joints.1").commanded
