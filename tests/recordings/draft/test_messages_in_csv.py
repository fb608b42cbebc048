"""Messages that Python wrote into CSV: lists of numbers and names in a cell each."""

from __future__ import annotations

import csv
from array import array
from pathlib import Path

import numpy as np
import pytest

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import is_list_of_numbers, list_in
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.made_logs import urdf_of

TIME = np.arange(0.0, 1.5, 0.01)
ANGLE = np.column_stack([np.sin(2.0 * TIME), np.cos(3.0 * TIME)])


@pytest.mark.parametrize(
    "cell, inner",
    [
        ("array('d', [0.1, -2e-3])", "0.1, -2e-3"),
        ("array('f', [0.5])", "0.5"),
        ("array('d')", ""),
        ("array([1.0, 2.0], dtype=float32)", "1.0, 2.0"),
        ("np.array([1.0, 2.0])", "1.0, 2.0"),
        ("[0.1 0.2]", "0.1 0.2"),
        ("['j1', 'j2']", "'j1', 'j2'"),
    ],
)
def test_a_list_is_what_stands_between_its_brackets(cell: str, inner: str) -> None:
    assert list_in(cell) == inner


@pytest.mark.parametrize("cell", ["array", "arrayed('d', [1])", "0.1", "", "array('d', [0.1"])
def test_other_cells_are_no_lists(cell: str) -> None:
    assert list_in(cell) is None


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_messages_of_rclpy_are_drafted_with_the_names_that_they_hold(tmp_path: Path, delimiter: str) -> None:
    path = tmp_path / "states.csv"
    with path.open("w", newline="") as file:
        rows = csv.writer(file, delimiter=delimiter)
        rows.writerow(["sec", "nanosec", "name", "position", "effort"])
        for t, angle in zip(TIME, ANGLE, strict=True):
            lists = array("d", angle), array("d")
            rows.writerow([int(t) + 1712, round(t % 1.0 * 1e9), ["elbow", "shoulder"], *lists])
    draft = draft_any([path], urdf_of(("shoulder", "elbow")), None)
    assert draft.joints == ["shoulder", "elbow"]
    position = draft.channels["states"]["position"]
    assert position["formula"] == ["position[1]", "position[0]"]
    source = draft.sources[next(iter(draft.sources))]
    assert source["time"] == {"column": "sec", "nanoseconds": "nanosec"}
    reasons = [guess.reason for guess in draft.guesses]
    assert "the log's own columns of names: 0 is elbow, 1 is shoulder" in reasons
    options = CsvOptions(**source.get("csv", {}))
    np.testing.assert_allclose(read_table(path, options, "the log").numbers("position", "the log"), ANGLE)


@pytest.mark.parametrize(
    "cell",
    [
        "array(" + " " * 20_000, "array('d'" + " " * 20_000 + "x", "array('d', [" + "1," * 20_000,
        "[" + "1" * 20_000 + "x]", "1 " * 20_000 + "x",
    ],
    ids=["blanks", "blanks behind a type", "no end", "a long number", "many numbers"],
)  # fmt: skip
def test_a_long_cell_that_is_no_list_is_no_list_at_once(cell: str) -> None:
    """20,000 blanks in a row were parted among three places in every way: for hours."""
    assert not is_list_of_numbers(cell)
