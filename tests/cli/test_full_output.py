"""A standard output without room: the command goes on, its files are written, and the loss is said."""

from __future__ import annotations

import errno
import io
import os
import sys
from pathlib import Path

import pytest
from rich.console import Console

from samrl_ros.cli import main
from samrl_ros.contract import interrupts
from samrl_ros.contract.full_output import FullOutput

FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="only Linux has a device that is always full")
@pytest.mark.parametrize(("own", "code"), [(0, 1), (3, 3), (4, 4)])
def test_what_does_not_fit_is_left_out_and_the_files_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], own: int, code: int
) -> None:
    """`samrl diagnose ... > full` ended at its first note, without a report, and named a file "."."""
    report, codes = tmp_path / "report.json", []

    def command(arguments: list[str]) -> int:
        Console().print("note: a rate is odd")
        report.write_text("{}")
        print("a cause was found", flush=True)
        return own

    monkeypatch.setattr(main, "run", command)
    monkeypatch.setattr(main, "leave_quietly", lambda: None)
    monkeypatch.setattr(interrupts, "leave", codes.append)
    with FULL.open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        main.main()
    assert report.exists() and codes == [code]
    assert "standard output: No space left on device; what was printed is lost" in capsys.readouterr().err


def test_what_fits_is_printed_and_a_pipe_that_nobody_reads_ends_the_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        output = FullOutput()
        print("a line")
        assert output.lost() == "" and os.read(reading, 100) == b"a line\n"
        os.close(reading)
        print("another")
        with pytest.raises(OSError) as refused:
            sys.stdout.flush()
        assert refused.value.errno == errno.EPIPE
        sys.stdout.buffer.raw.close()


def test_a_captured_output_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", captured := io.StringIO())
    assert FullOutput().lost() == "" and sys.stdout is captured
