"""Layouts of others' logs that were taken for what they are not, or refused though nothing was missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.readings.reading_draft import says_truth
from tests.recordings.draft.test_told_by_model import COUNT, POSITION, TIME, TORQUE

SECONDS = np.arange(0.0, 6.0, 0.01)


def drafted(path: Path, text: str) -> Draft:
    path.write_text(text)
    return draft_any([path], None, None)


def joint_rows(separator: str) -> str:
    rows = [("time", "q1_rad", "tau1_Nm"), *zip(SECONDS, np.sin(SECONDS), np.cos(SECONDS), strict=True)]
    return "\n".join(separator.join(str(cell) for cell in row) for row in rows) + "\n"


@pytest.mark.parametrize("name", ["run.dat", "run.log", "run.t", "run"])
@pytest.mark.parametrize("separator", [",", "\t"])
def test_a_table_in_text_may_have_any_suffix(tmp_path: Path, name: str, separator: str) -> None:
    draft = drafted(tmp_path / name, joint_rows(separator))
    assert draft.sources["states"]["file"] == name
    assert draft.channels["states"]["position"]["unit"] == "rad"


@pytest.mark.parametrize(
    "text", ["# Notes\n\nOn 3 May 2 runs.\n" * 20, "x = 1\ny = 2\n" * 20, "\0\1\2,3\n" * 30]
)
def test_other_files_are_no_tables(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match="unknown kind"):
        drafted(tmp_path / "a.dat", text)


def test_signals_in_rows_are_refused_with_what_to_do(tmp_path: Path) -> None:
    table = np.array([SECONDS, np.sin(SECONDS), np.cos(SECONDS)])
    np.savetxt(tmp_path / "data.txt", table)  # as scripts write numpy.array(signals)
    with pytest.raises(InputError, match=r"3 rows of 600 numbers: a signal in each row.*Turn it over"):
        draft_any([tmp_path / "data.txt"], None, None)


def test_traces_of_a_drive_are_no_track(tmp_path: Path) -> None:
    names = ["Param [0x2201/93]", "Value [0x4C01/2]"]
    rows = [f"{k},{1500 + round(300 * np.sin(k / 90))},{k},{round(40 * np.cos(k / 90))}" for k in range(600)]
    draft = drafted(tmp_path / "trace.csv", "\n".join([",,".join(names) + ",", "X,Y,X,Y", *rows]) + "\n")
    assert draft.kind == "joints"
    assert draft.sources["states"]["csv"]["header"][::2] == [f"{names[0]} X (1)", f"{names[1]} X (2)"]
    used = draft.sources["states"]["columns"].values()
    assert used and all(" Y (" in column for column in used)


@pytest.mark.parametrize(
    ("truth", "reading"),
    [("tape_mm", "lidar_mm"), ("Actual Distance (mm)", "VL53L0X (mm)"), ("known_cm", "ultrasonic_cm")],
)
def test_a_sensor_by_its_make_against_a_tape(tmp_path: Path, truth: str, reading: str) -> None:
    assert says_truth(truth)
    rows = [f"{d},{1.02 * d + 0.1 * k:.1f}" for d in (200, 400, 600, 800) for k in range(8)]
    draft = drafted(tmp_path / "a.csv", "\n".join([f"{truth},{reading}", *rows]) + "\n")
    assert draft.sources["log"]["columns"] == {"reading": reading, "reference": truth}
    assert not draft.questions


@pytest.mark.parametrize("timed", [False, True])
def test_measured_against_expected_is_asked(tmp_path: Path, timed: bool) -> None:
    rows = [f"{0.01 * k},{d},{d + 9.5}" for k, d in enumerate(np.tile(np.arange(50, 155, 5), 4))]
    text = "\n".join(["time,expected,measured", *rows]) + "\n"
    if not timed:
        text = "\n".join(line.partition(",")[2] for line in text.splitlines()) + "\n"
    draft = drafted(tmp_path / "a.csv", text)
    assert draft.kind == ("joints" if timed else "readings")  # beside a time it may be a controlled joint
    assert timed or any("are they a sensor's distances" in question for question in draft.questions)


@pytest.mark.parametrize("effort", [Effort.link, Effort.drive])
def test_torques_of_the_other_sign_are_asked_for(tmp_path: Path, effort: Effort) -> None:
    names = ["time", *(f"q{k}" for k in range(COUNT)), *(f"tau{k}" for k in range(COUNT))]
    table = np.column_stack([TIME, POSITION, -TORQUE])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    draft = draft_mapping([tmp_path / "a.csv"], PANDA.urdf.read_text(), str(PANDA.urdf), effort)
    name = "states" if effort is Effort.link else "commanded_effort"
    assert all(formula.startswith("-") for formula in draft.channels[name]["effort"]["formula"])
    (question,) = draft.questions  # the model answers all others
    assert question.startswith(f"channels.{name}.effort: does the log give the reaction")


def test_columns_named_as_joints_are_their_positions_if_that_is_so(tmp_path: Path) -> None:
    names = ["time", *(f"panda_joint{k}" for k in range(1, COUNT + 1)), "panda_gripper"]
    table = np.column_stack([TIME, POSITION, np.full(len(TIME), 100.0)])
    path = tmp_path / "recorded.csv"  # as Baxter's joint_recorder writes it
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    draft = draft_mapping([path], PANDA.urdf.read_text(), str(PANDA.urdf), Effort.none)
    assert any("named as joints their positions" in question for question in draft.questions)
    assert list(draft.sources["states"]["columns"].values()) == names[1:-1]
    with pytest.raises(InputError, match="URDF by --urdf if columns are called as its joints"):
        draft_mapping([path], None, None, Effort.none)


def test_torques_of_solo_are_the_measured_ones(tmp_path: Path) -> None:
    arrays = {"q_mes": POSITION, "tau_ff": TORQUE, "torquesFromCurrentMeasurment": TORQUE, "tstamps": TIME}
    np.savez(tmp_path / "solo.npz", **arrays)
    draft = draft_mapping([tmp_path / "solo.npz"], None, None, Effort.drive)
    columns = draft.sources["states"]["columns"].values()
    assert set(columns) == {"q_mes", "torquesFromCurrentMeasurment"}  # tau_ff is what was fed forward
    assert draft.sources["states"]["time"]["column"] == "tstamps"
