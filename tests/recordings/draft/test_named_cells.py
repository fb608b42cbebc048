"""Tables whose every line repeats the names of its columns, and tables below several lines of names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.text_layout import stated_options, text_options
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.importer import ImportedRecording
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.made_logs import urdf_of

NUMBERS = [[0.1, 2.0, 3.0], [0.2, 3.0, 4.0], [0.3, 4.0, 5.5], [0.4, 4.0, -1e-3]]
PAIRS = [f"t:{t},pos:{p},v deg/s:{v}" for t, p, v in NUMBERS]
GROUPS = [[*row, *row[1:]] for row in NUMBERS]
BELOW = [",".join(map(str, row)) for row in GROUPS]
NAMES = ["time", "hip_p", "hip_v", "knee_p", "knee_v"]
JOINTS = ("hip", "knee")


def as_drafted(path: Path, lines: list[str]) -> tuple[dict, Table]:
    path.write_text("\n".join(lines) + "\n")
    options = text_options(path)
    return stated_options(options), read_table(path, options, "it")


@pytest.mark.parametrize(
    ("name", "lines", "stated"),
    [
        ("a.txt", PAIRS, {"pairs": ":"}),
        ("a.log", PAIRS, {"pairs": ":"}),
        ("a.txt", [line + "," for line in PAIRS], {"pairs": ":"}),
        ("a.txt", [line.replace(",", ", ").replace(":", ": ") for line in PAIRS], {"pairs": ":"}),
        ("a.tsv", [line.replace(",", "\t") for line in PAIRS], {"pairs": ":"}),
        ("a.txt", [line.replace(",", "\t") for line in PAIRS], {"pairs": ":", "delimiter": "\t"}),
        (
            "a.txt", [line.replace(",", ";").replace(".", ",") for line in PAIRS],
            {"pairs": ":", "delimiter": ";", "decimal": ","},
        ),
        (
            "a.txt", ["Baud: 115200", "ready.", "", "os:3.0,v deg/s:2.0", *PAIRS],  # opened amid a line
            {"pairs": ":", "skip_lines": 4},
        ),
    ],
)  # fmt: skip
def test_names_that_each_line_repeats_are_the_columns(
    name: str, lines: list[str], stated: dict, tmp_path: Path
) -> None:
    said, table = as_drafted(tmp_path / name, lines)
    assert said == stated
    assert list(table.columns) == ["t", "pos", "v deg/s"]
    np.testing.assert_allclose(np.stack([table.numbers(n, "it") for n in table.columns], axis=1), NUMBERS)


@pytest.mark.parametrize("form", ["t={} pos={}  v={}", "t = {} pos = {} v = {}", "t={}\t pos={} v={}"])
def test_blanks_may_part_names_and_numbers(form: str, tmp_path: Path) -> None:
    said, table = as_drafted(tmp_path / "a.txt", [form.format(*row) for row in NUMBERS])
    assert said["pairs"] == "="
    np.testing.assert_allclose(np.stack([table.numbers(n, "it") for n in ("t", "pos", "v")], axis=1), NUMBERS)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("t:0.5,pos:1", "line 4 of a.txt is 't:0.5,pos:1', must be 't:...,pos:...,v deg/s:...'"),
        ("t:0.5,speed:1,v deg/s:1", "line 4 .*must be 't:"),
        ("t:0.5,v deg/s:1,pos:1", "line 4 .*must be 't:"),  # in another order
        ("E (311) sensor timeout", "line 4 .*correct or delete that line"),
        ("t:0.5,pos:ovf,v deg/s:1", "line 4 of a.txt has 'pos' 'ovf', must be a number.*delete that line"),
    ],
)
def test_a_line_of_other_names_or_without_a_number_is_refused(
    line: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / "a.txt").write_text("\n".join([*PAIRS[:3], line, *PAIRS]))
    with pytest.raises(InputError, match=message):
        read_table(tmp_path / "a.txt", text_options(tmp_path / "a.txt"), "it")


@pytest.mark.parametrize("end", ["t:0.5,pos:7", "t:0.5,po", "t:0.5,pos:7,v de"])
def test_a_last_line_that_was_cut_is_left_out(end: str, tmp_path: Path) -> None:
    _, table = as_drafted(tmp_path / "a.txt", [*PAIRS, end])
    assert len(table.numbers("t", "it")) == len(PAIRS)
    assert table.notes == ["line 5, the last of a.txt, is cut short and left out"]


def test_no_value_behind_a_name_is_an_empty_cell(tmp_path: Path) -> None:
    _, table = as_drafted(tmp_path / "a.txt", [PAIRS[0], "t:0.2,pos:,v deg/s:1", *PAIRS[2:]])
    assert np.isnan(table.numbers("pos", "it")).tolist() == [False, True, False, False]


def test_text_and_dates_may_stand_behind_names(tmp_path: Path) -> None:
    lines = [f"at:2026-03-01T12:00:0{k},{row},mode:run" for k, row in enumerate(PAIRS)]
    _, table = as_drafted(tmp_path / "a.txt", lines)
    assert np.diff(table.times("at", "it")).tolist() == [1.0, 1.0, 1.0]
    assert set(table.columns["mode"]) == {"run"}


@pytest.mark.parametrize(
    ("above", "count"),
    [
        ([",hip,hip,knee,knee", ",p,v,p,v", "time,,,,"], 3),  # pandas, of an index with a name
        (["joint,hip,hip,knee,knee", "quantity,p,v,p,v", "time,,,,"], 3),  # and levels with names
        (["time,hip,hip,knee,knee", ",p,v,p,v"], 2),
        (["time,hip,,knee,", ",p,v,p,v"], 2),  # merged cells
        ([",hip,,knee,", "time,p,v,p,v"], 2),
        ([",hip,Unnamed: 2_level_0,knee,Unnamed: 4_level_0", "time,p,v,p,v"], 2),
    ],
)
def test_lines_of_names_are_joined(above: list[str], count: int, tmp_path: Path) -> None:
    said, table = as_drafted(tmp_path / "a.csv", [*above, *BELOW])
    assert said == {"header_lines": count}
    assert list(table.columns) == NAMES
    np.testing.assert_allclose(np.stack([table.numbers(n, "it") for n in NAMES], axis=1), GROUPS)


def test_what_pandas_writes_is_read_back(tmp_path: Path) -> None:
    names = pd.MultiIndex.from_product([["left", "right"], ["is", "set"], ["q", "dq"]])
    values = np.arange(48.0).reshape(6, 8)
    index = pd.Index(0.1 * np.arange(6), name="t")
    for sep, name in ((",", "a.csv"), (";", "b.csv"), ("\t", "c.tsv")):
        pd.DataFrame(values, index, names).to_csv(tmp_path / name, sep=sep)
        table = read_table(tmp_path / name, text_options(tmp_path / name), "it")
        assert list(table.columns) == ["t", *("_".join(each) for each in names)]
        np.testing.assert_allclose(table.numbers("right_is_dq", "it"), values[:, 5])


def test_titles_units_and_types_above_names_are_no_groups(tmp_path: Path) -> None:
    rows = ["0.1,2,3", "0.2,3,4", "0.3,4,5"]
    for title in ("Recorder 3,,", "Recorder 3,2026-03-01,", "s,mm,mm", "float,float,float"):
        _, table = as_drafted(tmp_path / "a.csv", [title, "t,x,y", *rows])
        assert list(table.columns) == ["t", "x", "y"]


def test_as_many_lines_as_a_mapping_says_must_be_names(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\n".join([",hip,hip,knee,knee", "time,p,v,p,v", *BELOW]))
    with pytest.raises(InputError, match=r"line 3 of a.csv is '0.1,2.0.*must be one of 3 lines of 5 names"):
        read_table(tmp_path / "a.csv", CsvOptions(header_lines=3), "it")
    with pytest.raises(InputError, match="has header_lines, whose names"):
        CsvOptions.read({"header_lines": 2, "pairs": ":"}, "it")


def swinging(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = 0.01 * np.arange(count)
    phase = time[:, None] * [2.0, 3.0]
    return time, 0.4 * np.sin(phase), 0.4 * np.cos(phase) * [2.0, 3.0]


def drafted(folder: Path) -> Draft:
    (folder / "robot.urdf").write_text(urdf_of(JOINTS))
    return draft_any([folder], urdf_of(JOINTS), "robot.urdf", Effort.drive)


def imported(folder: Path, draft: Draft) -> list[ImportedRecording]:
    """By what is drafted, when its questions are answered by deleting them."""
    text = re.sub(r"^questions:\n(  - .*\n)+", "", as_yaml(draft), flags=re.MULTILINE)
    (folder / "m.yaml").write_text(text)
    return list(import_any(folder / "m.yaml", folder, None).made)


def test_letters_of_drives_are_asked_for_and_hold_in_each_file(tmp_path: Path) -> None:
    time, position, velocity = swinging(400)
    what = ["p", "v", "t_ff", "t"]
    names = pd.MultiIndex.from_product([JOINTS, what])
    zero, torque = np.zeros_like(position), 0.2 * np.sin(7.0 * time[:, None] + [0.0, 1.0])
    values = np.stack([position, velocity, zero, torque], axis=2).reshape(len(time), -1)
    frame = pd.DataFrame(values, pd.Index(time, name="time"), names)
    for run in ("run1", "run2"):
        frame.to_csv(tmp_path / f"{run}.csv")
    draft = drafted(tmp_path)
    assert sum("do p, v and t" in question for question in draft.questions) == 1
    states, source = draft.channels["states"], draft.sources["states"]
    assert source["csv"] == {"header_lines": 3}
    assert source["time"] == {"column": "time", "unit": "s"}  # and no torque
    assert [source["columns"][key] for key in states["velocity"]["formula"]] == ["hip_v", "knee_v"]
    effort = draft.channels["commanded_effort"]["effort"]["formula"]
    assert [source["columns"][key] for key in effort] == ["hip_t", "knee_t"]
    frame[frame.columns[::-1]].to_csv(tmp_path / "run2.csv")  # its own names are its columns'
    one, other = imported(tmp_path, draft)
    np.testing.assert_array_equal(one.recording.states.position, other.recording.states.position)


def test_a_folder_of_named_cells_is_drafted_and_imported(tmp_path: Path) -> None:
    for run in ("run1", "run2"):
        lines = [
            f"t_ms:{1e3 * t:.0f},hip_deg:{p[0]:.5f},knee_deg:{p[1]:.5f},hip_tau:{v[0]:.4f},knee_tau:{v[1]}"
            for t, p, v in zip(*swinging(400), strict=True)
        ]
        (tmp_path / f"{run}.txt").write_text("\n".join(lines))
    draft = drafted(tmp_path)
    assert draft.sources["states"]["file"] == "{name}.txt"
    assert draft.sources["states"]["csv"] == {"pairs": ":"}
    assert draft.sources["states"]["time"] == {"column": "t_ms", "unit": "ms"}
    imported(tmp_path, draft)
    lines = (tmp_path / "run2.txt").read_text().splitlines()
    lines[200] = lines[200].replace("hip_deg", "hip_rad")
    (tmp_path / "run2.txt").write_text("\n".join(lines))
    with pytest.raises(InputError, match="line 201 of run2.txt"):
        imported(tmp_path, draft)
