"""Text files as tables: every digit kept, every cell that does not fit its column or header refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table


@pytest.fixture
def read(tmp_path: Path):
    def make(text: str, suffix: str = ".csv", **options: object) -> Table:
        path = tmp_path / f"log{suffix}"
        path.write_text(text)
        return read_table(path, CsvOptions.model_validate(options), "here")

    return make


def test_numbers_are_exact(read) -> None:
    values = np.random.default_rng(0).normal(size=2000) * 10.0 ** np.arange(-200, 200).repeat(5)
    table = read("a\n" + "\n".join(map(repr, values.tolist())))
    np.testing.assert_array_equal(table.numbers("a", "here"), values)


def test_missing_cells_of_every_spelling_and_short_rows_are_nan(read) -> None:
    table = read("a,b\n1,nan\n2,N/A\n3,-\n4,none\n5,\n6\n7, 8 \n")
    assert np.isnan(table.numbers("b", "here")).tolist() == [True] * 6 + [False]
    assert table.numbers("a", "here").tolist() == [1, 2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize("text", ["a,b\n1,2,3\n", "a,b\n1,2\n1,2,3\n", "a,b\n1,2,\n3,4,5\n"])
def test_rows_longer_than_the_header_are_refused(read, text: str) -> None:
    with pytest.raises(InputError, match=r"here: .*log\.csv cannot be read as \.csv"):
        read(text)


def test_dialects(read) -> None:
    text = "made by x\n% a b\n t ; q \n1,5;[1,5 2]\n2,5;[3 4]\n"
    table = read(text, delimiter=";", decimal=",", skip_lines=1, comment="%")
    assert table.numbers("t", "here").tolist() == [1.5, 2.5]
    assert table.numbers("q", "here").tolist() == [[1.5, 2.0], [3.0, 4.0]]
    assert read("1\t2\n3\t4\n", ".tsv", header=False).numbers("1", "here").tolist() == [2, 4]


def test_what_is_no_table_of_numbers_is_refused(read) -> None:
    with pytest.raises(InputError, match=r"names columns \['a'\] twice"):
        read("a,a\n1,2\n")
    with pytest.raises(InputError, match="cannot be read"):
        read("")
    with pytest.raises(InputError, match=r"column 'a' of log\.csv, row 1: 'True' is no number"):
        read("a\n1\nTrue\n").numbers("a", "here")
    with pytest.raises(InputError, match="row 1 has 1 numbers, others 2"):
        read('a\n"[1, 2]"\n[3]\n').numbers("a", "here")


def test_dates_carry_their_zone_and_microseconds(read) -> None:
    table = read("t,n\n2025-11-12T10:03:20.123456Z,1\n2025-11-12 11:03:21+01:00,2\n")
    assert table.times("t", "here").tolist() == [1762941800.123456, 1762941801.0]
    with pytest.raises(InputError, match="holds numbers, not ISO dates"):
        table.times("n", "here")
    with pytest.raises(InputError, match="row 0: 'noon' is no ISO 8601 date"):
        read("t\nnoon\n").times("t", "here")


def test_a_mat_file_that_kills_its_reader_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from samrl_ros.log_import.formats import arrays

    (tmp_path / "a.mat").write_bytes(bytes(200))
    monkeypatch.setattr(arrays.sys, "executable", "/bin/false")
    with pytest.raises(InputError, match="cannot be read as .mat"):
        read_table(tmp_path / "a.mat", CsvOptions(), "it")
