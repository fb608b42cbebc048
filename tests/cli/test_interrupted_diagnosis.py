"""A diagnosis of images that is stopped leaves nothing, or all of its report, and says which."""

from __future__ import annotations

import os
import signal
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from samrl_core.diagnosis import diagnose as diagnosing
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.diagnosis.report import write_report as writing
from samrl_core.diagnosis.report.json_report import read_report
from samrl_ros.cli.diagnosis import diagnose as command
from samrl_ros.cli.main import run
from tests.diagnosis.report import samples

pytestmark = pytest.mark.usefixtures("hangup")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FOUND = Recalibration("camera", (), (), (), numbers={"depth_scale": 0.02}, of_numbers=("depth_scale@camera",))


def asked(tmp_path: Path) -> list[str]:
    """A command line whose recordings and diagnosis are ready, so that only their use takes time."""
    bag = tmp_path / "A.mcap"
    bag.touch()
    return ["diagnose", str(bag), "--camera", "--apply", "--out", str(tmp_path / "report")]


@cache
def contents() -> dict[str, str | bytes]:
    """Of a report, drawn once."""
    return writing.report_contents(samples.diagnosis("effect"))


@pytest.fixture(autouse=True)
def diagnosed(monkeypatch: pytest.MonkeyPatch) -> None:
    far, drawn = SimpleNamespace(correction=FOUND, resimulations=()), contents()
    monkeypatch.setattr(writing, "report_contents", lambda _: drawn)
    monkeypatch.setattr(command, "load", lambda *_: ([], [], []))
    monkeypatch.setattr(diagnosing, "diagnose", lambda *_: (samples.diagnosis("effect"), far))


def stops(number: signal.Signals, then: Any) -> Any:
    """A function in the midst of which a signal comes."""

    def stopped(*given: Any) -> Any:
        os.kill(os.getpid(), number)
        return then(*given)

    return stopped


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("at", ["diagnose", "report_contents"])
def test_what_is_lost_is_said_and_the_same_command_works(
    at: str, number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    arguments, module = asked(tmp_path), diagnosing if at == "diagnose" else writing
    with monkeypatch.context() as patch:
        patch.setattr(module, at, stops(number, getattr(module, at)))
        assert run(arguments) == 130
    said = capfd.readouterr()
    assert not (tmp_path / "report").exists() and said.err == ""
    assert number == signal.SIGHUP or "0 s of work are lost, nothing was written" in said.out
    assert run(arguments) == 0 and (tmp_path / "report" / "report.json").exists()


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("nth", [1, 3, 4])
def test_a_report_that_is_being_written_is_written_whole(
    nth: int, number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    whole, count = tmp_path / "whole", iter(range(1, 9))
    assert run([*asked(tmp_path)[:-1], str(whole)]) == 0
    capfd.readouterr()
    replace = os.replace

    def stopped(*given: Any) -> None:
        if next(count) == nth:
            os.kill(os.getpid(), number)
        replace(*given)

    monkeypatch.setattr(Path, "replace", stopped)
    assert run(asked(tmp_path)) == 130
    said = capfd.readouterr()
    out = tmp_path / "report"
    assert [sorted(p.relative_to(f) for p in f.rglob("*")) for f in (out, whole)] == [
        sorted(p.relative_to(whole) for p in whole.rglob("*"))
    ] * 2
    assert read_report(out / "report.json")["verdict"] == "effect" and (out / "apply" / "cell.json").exists()
    assert number == signal.SIGHUP or "the report was written already: it is whole" in said.out
