"""How text files are written, told from their first lines, and what a mapping states of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.text_layout import stated_options, text_options
from samrl_ros.log_import.specs import CsvOptions, TimeSpec
from samrl_ros.log_import.tables import read_table

NUMBERS = [[0.1, 2.0, 3.0], [0.2, 3.0, 4.0], [0.3, 4.0, 5.5]]
PLAIN = ["0.1,2,3", "0.2,3,4", "0.3,4,5.5"]


@pytest.mark.parametrize(
    ("name", "lines", "stated", "names"),
    [
        ("plain.csv", ["t,x,y", *PLAIN], {}, ["t", "x", "y"]),
        ("bare.csv", PLAIN, {"header": False}, ["0", "1", "2"]),
        ("numbered.csv", ["0,1,2", *PLAIN], {}, ["0", "1", "2"]),  # as pandas writes columns without names
        ("hash.csv", ["#t, x, y", *PLAIN], {}, ["#t", "x", "y"]),
        ("tabs.tsv", ["t\tx\ty", *[r.replace(",", "\t") for r in PLAIN]], {}, ["t", "x", "y"]),
        (
            "blanks.txt", ["% made by hand", "% t  x  y", *[r.replace(",", "   ") for r in PLAIN]],
            {"delimiter": " ", "header": ["t", "x", "y"], "comment": "%"}, ["t", "x", "y"],
        ),
        (
            "german.csv", ["Zeit;x;y", "0,1;2,0;3,0", "0,2;3,0;4,0", "0,3;4,0;5,5"],
            {"delimiter": ";", "decimal": ","}, ["Zeit", "x", "y"],
        ),
        (
            "above.csv", ["Recorder 3", "on 1.2.26, at 12", "", "t,x,y", *PLAIN],
            {"skip_lines": 3}, ["t", "x", "y"],
        ),
        (
            "units.csv", ["t,x,y", "(s),(mm),(mm)", *PLAIN],
            {"skip_lines": 2, "header": ["t [s]", "x [mm]", "y [mm]"]}, ["t [s]", "x [mm]", "y [mm]"],
        ),
        (  # the names stand below a comment, not in it
            "below.csv", ["# a tape's distances", "t;x [mm];y", *[r.replace(",", ";") for r in PLAIN]],
            {"delimiter": ";", "comment": "#", "skip_lines": 2, "header": ["t", "x [mm]", "y"]},
            ["t", "x [mm]", "y"],
        ),
        (  # a recorder that was asked for one signal twice
            "twice.csv", ["t,x,x", *PLAIN],
            {"skip_lines": 1, "header": ["t", "x", "x (2)"]}, ["t", "x", "x (2)"],
        ),
        (  # a delimiter behind the last name
            "behind.csv", ["t,x,y,", *PLAIN], {"skip_lines": 1, "header": ["t", "x", "y"]}, ["t", "x", "y"],
        ),
        (  # and behind every number
            "ends.csv", ["t,x,y", *[f"{r}," for r in PLAIN]],
            {"skip_lines": 1, "header": ["t", "x", "y", "(empty)"]}, ["t", "x", "y"],
        ),
        (  # what a serial monitor kept of a board that prints names before its numbers
            "serial.csv",
            ["=~=~ log 2018.05.10 =~=~", *["t,{},PWM,{},Enc1,{}".format(*r.split(",")) for r in PLAIN]],
            {"skip_lines": 1, "header": ["(t)", "t", "(PWM)", "PWM", "(Enc1)", "Enc1"]}, ["t", "PWM", "Enc1"],
        ),
    ],
)  # fmt: skip
def test_a_text_file_is_read_as_it_was_written(
    name: str, lines: list[str], stated: dict, names: list[str], tmp_path: Path
) -> None:
    (tmp_path / name).write_text("\n".join(lines) + "\n")
    options = text_options(tmp_path / name)
    assert stated_options(options) == stated
    table = read_table(tmp_path / name, options, "it")
    assert [name for name in table.columns if not name.startswith("(")] == names
    np.testing.assert_allclose(np.stack([table.numbers(n, "it") for n in names], axis=1), NUMBERS)


def test_names_that_do_not_fit_their_rows_are_no_names_of_them(tmp_path: Path) -> None:
    (tmp_path / "arm.csv").write_text("\n".join(["q1,q2,q3,dq1,dq2", *PLAIN]))
    with pytest.raises(InputError, match=r"arm.csv: the line of names has 5 \(q1, q2, q3, .*hold 3 .*header"):
        text_options(tmp_path / "arm.csv")


def test_a_column_alone_has_no_name(tmp_path: Path) -> None:
    (tmp_path / "stamps.csv").write_text("\n".join(f"{1470744587.966 + k:.6f}" for k in range(5)))
    assert text_options(tmp_path / "stamps.csv") == CsvOptions(header=False)


def test_a_listed_header_must_fit_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\n".join(PLAIN))
    with pytest.raises(InputError, match="lists 2 columns, a.csv has 3"):
        read_table(tmp_path / "a.csv", CsvOptions(header=["t", "x"]), "it")


def test_what_is_no_table_keeps_the_defaults(tmp_path: Path) -> None:
    for text in ("", "one\n", "# nothing\n", "a,b\nc,d\n"):
        (tmp_path / "a.csv").write_text(text)
        assert text_options(tmp_path / "a.csv") == CsvOptions()
    for content in (b"\xff\xfe\x00", b"\x00\x01", b"t,x\n1,\x00\n"):
        (tmp_path / "a.csv").write_bytes(content)
        with pytest.raises(InputError, match="cannot be read as text"):
            text_options(tmp_path / "a.csv")


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-8-sig", "utf-16"])
def test_umlauts_and_degrees_hinder_no_numbers(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "messung.csv"
    rows = "\r\n".join(row.replace(",", ";").replace(".", ",") for row in PLAIN)
    file.write_bytes(f"Höhe 0,75 m\r\nZeit (s);x;Winkel (°)\r\n{rows}\r\n".encode(encoding))
    options = text_options(file)
    assert stated_options(options) == {"delimiter": ";", "decimal": ",", "skip_lines": 1}
    table = read_table(file, options, "it")
    assert list(table.columns) == ["Zeit (s)", "x", "Winkel (°)"]
    np.testing.assert_allclose(table.numbers("Winkel (°)", "it"), [3.0, 4.0, 5.5])


def test_a_column_may_count_frames(tmp_path: Path) -> None:
    assert TimeSpec.read({"column": "frame", "rate_hz": 120}, "it").rate_hz == 120
    with pytest.raises(InputError, match="counts frames"):
        TimeSpec.read({"column": "frame", "rate_hz": 120, "unit": "ms"}, "it")
    with pytest.raises(InputError, match="must have column or rate_hz"):
        TimeSpec.read({}, "it")
