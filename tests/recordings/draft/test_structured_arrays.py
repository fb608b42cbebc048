"""Structured arrays of NumPy: their fields are columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from tests.recordings.logs.made_logs import urdf_of

TIME = np.arange(0.0, 1.5, 0.01)
ANGLE = np.column_stack([np.sin(2.0 * TIME), np.cos(3.0 * TIME)])


def states() -> np.ndarray:
    inner = np.dtype([("cur", "<f4"), ("ok", "?")])
    array = np.zeros(len(TIME), [("time", "<f8"), ("q", "<f8", (2,)), ("mode", "U4"), ("motor", inner)])
    array["time"], array["q"], array["mode"] = TIME, ANGLE, "run"
    array["motor"]["cur"] = 0.5
    return array


def test_fields_are_columns_and_drafted(tmp_path: Path) -> None:
    path = tmp_path / "leg.npy"
    np.save(path, states())
    table = read_table(path, CsvOptions(), "the log")
    assert list(table.columns) == ["time", "q", "motor.cur", "motor.ok"]
    np.testing.assert_array_equal(table.numbers("q", "the log"), ANGLE)
    draft = draft_any([path], urdf_of(("hip", "knee")), None)
    assert draft.channels["states"]["position"]["formula"] == ["q[0]", "q[1]"]
    assert draft.sources[next(iter(draft.sources))]["time"] == {"column": "time", "unit": "s"}


def test_a_structured_array_beside_others_says_whose_its_fields_are(tmp_path: Path) -> None:
    path = tmp_path / "leg.npz"
    np.savez(path, states=states(), tau=ANGLE)
    columns = read_table(path, CsvOptions(), "the log").columns
    assert list(columns) == ["states.time", "states.q", "states.motor.cur", "states.motor.ok", "tau"]


def test_fields_of_objects_are_not_unpickled(tmp_path: Path) -> None:
    path = tmp_path / "leg.npy"
    np.save(path, np.array([(0.0, "a")], [("t", "f8"), ("x", "O")]), allow_pickle=True)
    with pytest.raises(InputError, match="cannot be read as .npy"):
        read_table(path, CsvOptions(), "the log")
