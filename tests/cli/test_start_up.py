"""What nodes compile is read from their logs, line by line and once."""

from __future__ import annotations

from pathlib import Path

import pytest

from samrl_core.common.warp_runtime import COMPILING
from samrl_ros.cell.start_up import CompilationTeller


def test_lines_of_growing_logs_are_told_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    teller = CompilationTeller(tmp_path)
    teller.report()
    log = tmp_path / "model_updater.log"
    log.write_text(f"[INFO] something\n{COMPILING}: model.rendering")
    teller.report()
    assert capsys.readouterr().err == ""  # half a line
    with log.open("a") as file:
        file.write(".raster_kernels for cpu\n")
    teller.report()
    teller.report()
    assert capsys.readouterr().err == f"model_updater: {COMPILING}: model.rendering.raster_kernels for cpu\n"
