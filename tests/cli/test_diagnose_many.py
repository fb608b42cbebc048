"""`samrl diagnose --many`: what counts as a day, what is done again, and a joint that began to drag."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.cli.diagnosis import many
from samrl_ros.cli.main import run
from samrl_ros.contract.exit_codes import FAILED, INPUT_REFUSED
from samrl_ros.recordings.write import write_recording
from tests.diagnosis import worlds
from tests.diagnosis.worlds import LIFT

EFFECT = "coulomb_friction@joint:lift"


def touch(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return path


def names(sets: list[many.RecordingSet]) -> list[tuple[str, str]]:
    return [(s.robot, s.name) for s in sets]


def test_robots_and_their_days(tmp_path: Path) -> None:
    root = tmp_path / "cells"
    for place in (
        "a/d2/x.mcap",
        "a/d10/x.mcap",
        "b/2026-11-23/metadata.yaml",
        "b/log.parquet",
        "b/robot.urdf",
    ):
        touch(root / place)
    touch(root / "notes.txt")
    found = many.find_sets(root, tmp_path / "out", ("--seed", "3"))
    assert names(found) == [("a", "d2"), ("a", "d10"), ("b", "2026-11-23"), ("b", "log.parquet")]
    assert found[0].out == tmp_path / "out/a/d2" and found[0].options == ("--seed", "3")


def test_days_of_one_robot(tmp_path: Path) -> None:
    for place in ("d1/x.mcap", "d2/x.mcap"):
        touch(tmp_path / "arm" / place)
    assert names(many.find_sets(tmp_path / "arm", tmp_path / "out", ())) == [("arm", "d1"), ("arm", "d2")]


@pytest.mark.parametrize(
    ("content", "says"),
    [("[1, 2]", "it may have urdf"), ("urdff: x.urdf", "urdff"), ("urdf: [", "diagnose.yaml")],
)
def test_wrong_options_of_a_robot_are_refused(tmp_path: Path, content: str, says: str) -> None:
    touch(tmp_path / "a/d1/x.mcap")
    (tmp_path / "a/diagnose.yaml").write_text(content)
    with pytest.raises(InputError, match=says):
        many.find_sets(tmp_path, tmp_path / "out", ())


def test_options_of_a_robot_are_relative_to_its_folder(tmp_path: Path) -> None:
    touch(tmp_path / "a/d1/x.mcap")
    (tmp_path / "a/diagnose.yaml").write_text("urdf: model/arm.xacro\nxacro_arg: [a:=1, b:=2]\n")
    (found,) = many.find_sets(tmp_path, tmp_path / "out", ())
    model = str((tmp_path / "a/model/arm.xacro").resolve())
    assert found.options == ("--urdf", model, "--xacro-arg", "a:=1", "--xacro-arg", "b:=2")


@pytest.mark.parametrize(("name", "says"), [("none", "is no folder"), ("empty", "holds no recordings")])
def test_nothing_to_diagnose(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=says):
        many.find_sets(tmp_path / name, tmp_path / "out", ())


@pytest.mark.parametrize(
    ("name", "date"),
    [("run_2026-11-23", "2026-11-23"), ("20261123_1405", "2026-11-23"), ("2026-19-39", None), ("d7", None)],
)
def test_dates_in_names(tmp_path: Path, name: str, date: str | None) -> None:
    (tmp_path / name).mkdir()
    time_s = many._recorded(tmp_path / name)
    assert (None if time_s is None else f"{many.datetime.fromtimestamp(time_s, many.UTC):%Y-%m-%d}") == date


def test_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diagnose"]) == 3 and "no recording is named" in capsys.readouterr().err
    assert run(["diagnose", "x.mcap", "--many", str(tmp_path)]) == 3
    assert "leave out other bags" in capsys.readouterr().err
    assert run(["diagnose", "x.mcap", "--track", "friction"]) == 3


@pytest.fixture(scope="module")
def six_days(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A joint whose friction rises from what tolerances hide to 1.2 N m between the third and fourth day."""
    root = tmp_path_factory.mktemp("many") / "cells"
    for k in range(6):
        fields = {"coulomb": {LIFT: 1.2}} if k >= 3 else {}
        a, b, c = worlds.world(40 + k, **fields)
        for recording, name in ((a, "a"), (b, "b"), (c, "c")):
            start_s = 1.76e9 + 86400.0 * k
            write_recording(recording, root / f"arm/day{k}/{name}.mcap", start_s=start_s)
    (root / "arm/day9").mkdir()
    (root / "arm/day9/broken.mcap").write_bytes(b"no bag")
    (root / "arm/library.yaml").write_text("[coulomb_friction, viscous_friction, command_delay]")
    (root / "arm/diagnose.yaml").write_text("library: library.yaml")
    return root


def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the sets that are diagnosed from now on."""
    begun: list[str] = []
    before = many.run_set

    def run_set(job: many.RecordingSet) -> int:
        begun.append(f"{job.name}/{many.TRACKED}" if job.out.name == many.TRACKED else job.name)
        return before(job)

    monkeypatch.setattr(many, "run_set", run_set)
    return begun


@pytest.mark.slow
def test_a_joint_that_began_to_drag(
    six_days: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, begun = tmp_path / "out", calls(monkeypatch)
    assert run(["diagnose", "--many", str(six_days), "--out", str(out), "--fail-on-gap"]) == 4
    assert sorted(begun) == [
        *(f"day{k}{t}" for k in range(3) for t in ("", "/tracked")),
        *(f"day{k}" for k in (3, 4, 5, 9)),
    ]
    shown = capsys.readouterr().out
    assert "between day2 and day3" in shown and "refused" in shown
    content: dict[str, Any] = json.loads((out / "history.json").read_text())["robots"]["arm"]
    assert [d["verdict"] for d in content["days"]] == ["no_gap"] * 3 + ["effect"] * 3 + ["refused"]
    (series,) = [p for p in content["parameters"] if p["effect"] == EFFECT]
    (change,) = series["changes"]
    assert change["after"] == pytest.approx(1.2, rel=0.1) and abs(change["before"]) < 0.15
    for name in ("history.html", "history.png"):
        assert (out / name).stat().st_size > 1000
    begun.clear()
    assert run(["diagnose", "--many", str(six_days), "--out", str(out)]) == 0
    assert not begun  # all is there


@pytest.mark.parametrize(("refused", "lasts"), [(True, True), (False, False)])
def test_a_breakdown_is_no_refusal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: bool, lasts: bool
) -> None:
    """A day whose diagnosis ran out of memory was called refused, and never tried again."""
    told = "refused: x is not sure:\n  joints: which?" if refused else "Traceback:\nMemoryError: too large"

    def ended(command: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(command, INPUT_REFUSED if refused else FAILED, "", told)

    monkeypatch.setattr(many.subprocess, "run", ended)
    touch(tmp_path / "cells/a/d1/x.mcap")
    assert run(["diagnose", "--many", str(tmp_path / "cells"), "--out", str(tmp_path / "out")]) == 0
    (job,) = many.find_sets(tmp_path / "cells", tmp_path / "out", ())
    assert job.finished == lasts
    (day,) = json.loads((tmp_path / "out/history.json").read_text())["robots"]["a"]["days"]
    assert day["refusal"] == ("x is not sure: joints: which?" if refused else "MemoryError: too large")


def test_a_stopped_diagnosis_is_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    touch(tmp_path / "cells/a/d1/x.mcap")

    def stopped(*_: Any) -> Iterator[Any]:
        yield many.executor.Done(0, None, error=InterruptedError("stopped"))

    monkeypatch.setattr(many.executor, "run_in_threads", stopped)
    assert run(["diagnose", "--many", str(tmp_path / "cells"), "--out", str(tmp_path / "out")]) == 130
    assert "the same command goes on" in capsys.readouterr().out
    assert not (tmp_path / "out/history.json").exists()
