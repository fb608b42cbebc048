"""A log that does not exist is named first, whatever else was given."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.cli.bag import draft_command
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions


def test_a_log_that_does_not_exist_is_named_before_any_is_read(tmp_path: Path) -> None:
    there, missing = tmp_path / "a.csv", tmp_path / "b.csv"
    there.write_text("t,x\n")
    with pytest.raises(InputError, match=r"b\.csv does not exist; give"):
        load(DiagnoseOptions(bags=(there,), held_out=(missing,)))
    with pytest.raises(InputError, match=r"b\.csv does not exist; give"):
        draft_command([there, missing])
