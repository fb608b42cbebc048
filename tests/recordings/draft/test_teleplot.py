"""Lines of Teleplot: a row for each number, with its own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.formats.teleplot import is_teleplot
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.made_logs import urdf_of

MS = 48211 + 10 * np.arange(150)
ANGLE = np.sin(0.002 * (MS - MS[0]))


def table_of(path: Path, lines: list[str]) -> Table:
    path.write_text("\n".join(lines) + "\n")
    return read_table(path, CsvOptions(), "the log")


@pytest.mark.parametrize("name", ["run.txt", "run.log"])
def test_numbers_of_one_time_are_a_row(tmp_path: Path, name: str) -> None:
    lines = ["ready"]
    for ms, angle in zip(MS, ANGLE, strict=True):
        lines += [f">q:{ms}:{angle:.6f}§rad|g", f">volts:{ms + 1}:{angle:.3f}"]
    table = table_of(tmp_path / name, lines)
    assert list(table.columns) == ["time [s]", "q [rad]", "volts"]
    assert table.time == pytest.approx(1e-3 * MS)
    assert table.numbers("volts", "") == pytest.approx(ANGLE, abs=1e-3)
    assert table.notes == [f"{name}: lines that are no NAME:MS:NUMBER are left out, 1 of 301"]
    draft = draft_any([tmp_path / name], urdf_of(("wheel",)), None)
    assert draft.channels["states"]["position"]["unit"] == "rad"
    assert "time" not in draft.sources["states"]  # the file's own


def test_a_name_at_another_clock_is_said(tmp_path: Path) -> None:
    lines = [f"q:{ms}:{angle:.6f}" for ms, angle in zip(MS, ANGLE, strict=True)]
    lines += [f"slow:{ms}:1" for ms in MS[::2]] + [f"early:{ms - 90000}:1" for ms in MS]
    table = table_of(tmp_path / "run.txt", lines)
    assert np.isfinite(table.numbers("slow", "")).tolist() == [k % 2 == 0 for k in range(len(MS))]
    assert table.notes == [
        "slow has no number in 75 of 150 rows, which are the times of q",
        "early is at another clock than q and is left out: log both at one time",
    ]


def test_numbers_without_times_are_rows_by_their_count(tmp_path: Path) -> None:
    lines = [line for angle in ANGLE for line in (f">q:{angle:.6f}", ">u:1")]
    table = table_of(tmp_path / "run.txt", lines[:-1])  # cut within its last row
    assert table.time is None and table.numbers("q", "") == pytest.approx(ANGLE[:-1], abs=1e-6)
    with pytest.raises(InputError, match="different counts of numbers, 'q' 150, 'u' 155"):
        table_of(tmp_path / "run.txt", lines + [">u:1"] * 5)
    with pytest.raises(InputError, match="numbers of 'u' have no time, others have"):
        table_of(tmp_path / "run.txt", [">q:1:2", ">u:3", ">q:2:2"])


@pytest.mark.parametrize(
    "lines",
    [
        ["a:1", "b:2", "a:2"],
        ["12:30:45", "12:30:46", "12:30:47"],
        ["t:1,q:2"] * 3,
        ["time,q", "0,1"],
        ["a:" + "1" * 20_000 + "x"] * 3,
    ],
)
def test_other_texts_are_not_of_it(lines: list[str]) -> None:
    assert not is_teleplot(lines)
    assert is_teleplot([">q:1:2;2:3", "q:3:1e-3", ">q:-0.5"])
