"""Logs in the layouts of measuring software and of `rostopic echo -p`, which were refused or misread."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from samrl_core.common.errors import InputError
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.formats import mat_reader
from samrl_ros.log_import.importer import ImportedRecording
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table

COUNT, STEP = 300, 0.004
TIME = STEP * np.arange(COUNT)
ANGLE, SPEED = np.degrees(np.sin(2.0 * TIME)), np.degrees(2.0 * np.cos(2.0 * TIME))
SEGMENT = (
    "Channels\t2\t\t\nSamples\t{count}\t{count}\nDate\t2024/05/10\t2024/05/10\nY_Unit_Label\tdeg\tdeg/s\n"
    "X_Dimension\tTime\tTime\nX0\t0,5\t0,5\nDelta_X\t0,004\t0,004\n***End_of_Header***\t\t\n"
    "X_Value\tAngle\tAngle Speed\tComment\n"
)


def labview(times: str, rows: list[str]) -> str:
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
    head += f"Multi_Headings\tNo\nX_Columns\t{times}\nTime\t10:11:07,4413\n***End_of_Header***\t\n\t\n"
    return head + (SEGMENT.format(count=COUNT) + "\n".join(rows) + "\n").replace(".", ",")


def table_of(path: Path, text: str) -> Table:
    path.write_text(text)
    return read_table(path, CsvOptions(), "the log")


@pytest.mark.parametrize("times", ["One", "No"])
def test_labviews_measurement_has_its_own_times_and_units(tmp_path: Path, times: str) -> None:
    shown = [f"{t + 0.5:.6f}" if times == "One" else "" for t in TIME]
    rows = [f"{t}\t{a:.9f}\t{v:.9f}" for t, a, v in zip(shown, ANGLE, SPEED, strict=True)]
    table = table_of(tmp_path / "run.lvm", labview(times, rows))
    assert table.time == pytest.approx(TIME + 0.5)
    assert table.numbers("Angle [deg]", "") == pytest.approx(ANGLE)
    draft = draft_any([tmp_path / "run.lvm"], None, None)
    assert draft.channels["states"]["position"]["unit"] == "deg"
    assert draft.channels["states"]["velocity"]["unit"] == "deg/s"
    assert "time" not in draft.sources["states"]  # the file's own


def test_segments_of_other_channels_are_refused(tmp_path: Path) -> None:
    rows = [f"{t:.3f}\t{a:.3f}\t0" for t, a in zip(TIME, ANGLE, strict=True)]
    text = labview("One", [*rows, "", SEGMENT.format(count=1).replace("Angle Speed", "Torque") + rows[0]])
    with pytest.raises(InputError, match=r"segment 2 holds Angle \[deg\], Torque.* export a file for each"):
        table_of(tmp_path / "run.lvm", text)


@pytest.mark.parametrize("kept", range(30))
def test_a_measurement_that_ends_anywhere_is_refused_in_words(tmp_path: Path, kept: int) -> None:
    """Behind its second header there was no line to read: a traceback of the draft."""
    lines = labview("One", ["0,000\t0,1\t0,2"]).splitlines(keepends=True)
    path = tmp_path / "run.lvm"
    path.write_text("".join(lines[:kept]))
    with pytest.raises(InputError):
        draft_any([path], None, None)


@pytest.mark.parametrize("numbered", [False, True])
def test_each_channel_of_a_scope_has_its_time_beside_it(tmp_path: Path, numbered: bool) -> None:
    """Times are ms, or numbers of samples; a channel at another rate is left out and noted."""
    names = ["X.ActPos", "Y.ActPos", "Temp"]
    pairs = ["\t".join(f"Name\t{name}" for name in names), "SampleTime[ms]\t4\tSampleTime[ms]\t4"]
    head = ["Name\tScope Project", "File\tC:\\a.tcscopex", "", *pairs, "Unit\tmm\tUnit\tmm\tUnit\t(None)", ""]
    head[-3] += "\tSampleTime[ms]\t8"
    rows = [
        "\t".join([str(k if numbered else 4 * k), f"{a:.6f}"] * 2 + [str(8 * k), "21,5"]).replace(".", ",")
        for k, a in enumerate(ANGLE)
    ]
    table = table_of(tmp_path / "scope.csv", "\n".join([*head, *rows]) + "\n")
    assert table.time == pytest.approx(TIME)
    assert list(table.columns) == ["time [s]", "X.ActPos [mm]", "Y.ActPos [mm]"]
    assert table.numbers("Y.ActPos [mm]", "") == pytest.approx(ANGLE, abs=1e-6)
    assert table.notes == ["Temp has a time of its own and is left out: export it at one rate"]


def test_rows_of_a_time_series_database_become_columns(tmp_path: Path) -> None:
    note = "#group,false,false,false,false,true,true,true\n#datatype,string,long,dateTime:RFC3339,double,"
    note += (
        "string,string,string\n#default,_result,,,,,,\n,result,table,_time,_value,_field,_measurement,axis\n"
    )
    rows = [
        f",,{k},2024-06-03T07:33:{20 + t:09.6f}Z,{value:.9f},{field},robot,{axis}"
        for k, (field, axis, values) in enumerate(
            [("position", "theta", ANGLE), ("position", "z", SPEED), ("torque", "z", -SPEED)]
        )
        for t, value in zip(TIME, values, strict=True)
        if (k, t) != (2, TIME[7])  # one was lost
    ]
    table = table_of(tmp_path / "run.csv", note + "\n".join(rows) + "\n")
    assert list(table.columns)[1:] == ["position.theta", "position.z", "torque.z"]
    assert table.time is not None and np.diff(table.time) == pytest.approx(np.full(COUNT - 1, STEP), abs=1e-6)
    assert table.numbers("position.z", "") == pytest.approx(SPEED)
    assert np.flatnonzero(np.isnan(table.numbers("torque.z", ""))).tolist() == [7]


def test_a_row_that_stands_twice_is_refused(tmp_path: Path) -> None:
    row = ",,0,2024-06-03T07:33:20Z,1.0,position,robot"
    text = "#datatype,string,long,dateTime:RFC3339,double,string,string\n"
    text += f",result,table,_time,_value,_field,_measurement\n{row}\n{row}\n"
    with pytest.raises(InputError, match="'position' has two values at one time"):
        table_of(tmp_path / "run.csv", text)


def test_signals_of_a_simulink_scope_have_paths(tmp_path: Path) -> None:
    """An array of structs was passed over, and a scope's file held its time alone."""
    signals = np.zeros((1, 2), dtype=[("values", object), ("label", object)])
    signals[0, 0], signals[0, 1] = (np.ones((4, 2)), "theta"), (np.zeros((4, 1)), "i")
    cells = np.empty((1, 1), dtype=object)
    cells[0, 0] = np.full((4, 1), 7.0)
    savemat(tmp_path / "run.mat", {"Scope": {"time": np.arange(4.0), "signals": signals}, "c": cells})
    found = mat_reader.numbers(tmp_path / "run.mat")
    assert found["Scope.signals(1).values"].shape == (4, 2)
    assert found["Scope.signals(2).values"].shape == (4, 1)
    assert found["c{1}"].ravel().tolist() == [7.0] * 4


def test_a_matrix_with_its_time_in_the_first_row(tmp_path: Path) -> None:
    """As Simulink's To File stores it: what to write is said, and it is read then."""
    np.savez(tmp_path / "run.npz", ans=np.array([TIME, ANGLE, SPEED]))
    with pytest.raises(InputError, match=r"first of them the time.*transpose: true.*'ans\[0\]'"):
        draft_any([tmp_path / "run.npz"], None, None)
    mapping: dict[str, Any] = {
        "joints": ["j"],
        "sources": {
            "log": {
                "file": "run.npz",
                "time": {"column": "ans[0]"},
                "columns": {"x": {"column": "ans", "transpose": True}},
            }
        },
        "channels": {"states": {"position": {"formula": ["x[1]"], "unit": "deg"}}},
        "recordings": [{"name": "one"}],
    }
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    (made,) = import_any(tmp_path / "mapping.yaml", tmp_path, None).made
    assert isinstance(made, ImportedRecording)
    np.testing.assert_allclose(np.diff(made.recording.states.time), STEP, atol=1e-9)
    np.testing.assert_allclose(made.recording.states.position[:, 0], np.radians(ANGLE), atol=1e-9)


def test_joints_have_the_names_that_stand_beside_them(tmp_path: Path) -> None:
    """`rostopic echo -p` writes names in columns of their own; joints were taken in the URDF's order."""
    header = "%time,field.header.stamp,field.name0,field.name1,field.position0,field.position1"
    rows = [
        f"{k * 4_000_000},{k * 4_000_000},elbow,shoulder,{a:.6f},{v:.6f}"
        for k, (a, v) in enumerate(zip(np.sin(TIME), np.cos(TIME), strict=True), start=1)
    ]
    (tmp_path / "js.csv").write_text("\n".join([header, *rows]) + "\n")
    draft = draft_any([tmp_path / "js.csv"], None, None)
    assert draft.joints == ["elbow", "shoulder"]


def test_a_folder_says_why_none_of_its_logs_is_read(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("t,q\n1,2\n")
    with pytest.raises(
        InputError, match=r"none of the folder's 2 files can be read as a log; a\.csv: .*1 rows"
    ):
        draft_any([tmp_path], None, None)


def test_torques_in_per_cent_are_asked_for_their_rated_one(tmp_path: Path) -> None:
    rows = [f"{t:.3f},{q:.6f},{50 * q:.3f}" for t, q in zip(TIME, np.sin(TIME), strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t,ActPos [rad],ActTorque [%]", *rows]) + "\n")
    draft = draft_any([tmp_path / "run.csv"], None, None)
    assert any("in per cent of what?" in question for question in draft.questions)
