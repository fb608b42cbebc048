from __future__ import annotations

import json
import sys
import types
from pathlib import Path

import pytest
import yaml

from samrl_core.blind_test.scores.diagnosis_run import Job, can_hide, diagnose_world
from samrl_core.blind_test.scores.load import read_report
from samrl_core.blind_test.scores.study import Study
from samrl_core.common import parallel
from samrl_core.common.errors import InputError
from tests.waiting import PATIENCE_S

SPY = """
import json, os, pathlib, sys
args = sys.argv[1:]
out = pathlib.Path(args[args.index("--out") + 1]); out.mkdir()
library = pathlib.Path("library.yaml").read_text() if "--library" in args else None
secret = pathlib.Path({secret!r})
out.joinpath("report.json").write_text(json.dumps({{
    "verdict": "no_gap", "args": args, "library": library, "sees": secret.exists(),
    "bags": [pathlib.Path(x).read_text() for x in ("A.mcap", "B.mcap", "C.mcap")], "cwd": os.getcwd(),
    "environment": [v for v in os.environ.values() if str(secret.parent) in v]}}))
sys.exit({code})
"""


def study_with(tmp_path: Path, code: int = 0, body: str = SPY) -> tuple[Study, Job]:
    study = Study(tmp_path / "study")
    study.observations("w1").mkdir(parents=True)
    for part in "ABC":
        (study.observations("w1") / f"{part}.mcap").write_text(part)
    (study.root / "sealed").mkdir()
    study.label("w1").write_text("secret")
    script = tmp_path / "spy.py"
    script.write_text(body.format(secret=str(study.label("w1")), code=code))
    return study, Job(study.root, "w1", command=(sys.executable, str(script)), timeout_s=PATIENCE_S)


def test_the_process_has_the_recordings_and_not_the_labels(tmp_path: Path) -> None:
    study, job = study_with(tmp_path)
    run = diagnose_world(job)
    report = read_report(study.run_folder("diagnosis", "w1"))
    assert report is not None
    assert report["bags"] == ["A", "B", "C"]
    assert report["args"][:4] == ["A.mcap", "B.mcap", "--held-out", "C.mcap"]
    assert str(study.root) not in report["cwd"]
    assert report["environment"] == []
    assert report["sees"] is not can_hide()
    assert (run["isolation"] == "mount namespace") is can_hide()
    assert study.label("w1").read_text() == "secret"
    assert job.finished


def test_a_withheld_family_reaches_it_as_a_library_file(tmp_path: Path) -> None:
    study, job = study_with(tmp_path)
    diagnose_world(Job(**{**job.__dict__, "stage": "left_out", "library": ("payload", "cable")}))
    report = read_report(study.run_folder("left_out", "w1"))
    assert report is not None
    assert yaml.safe_load(report["library"]) == {"families": ["payload", "cable"]}
    assert not job.finished  # the other stage has no result yet


def test_a_crash_is_a_result(tmp_path: Path) -> None:
    study, job = study_with(tmp_path, code=1)
    assert diagnose_world(job)["exit_code"] == 1
    assert job.finished
    assert job.crashed
    assert read_report(study.run_folder("diagnosis", "w1")) is None


def test_an_interrupted_diagnosis_is_not_a_result(tmp_path: Path) -> None:
    study, job = study_with(tmp_path, code=130)
    with pytest.raises(InterruptedError, match="anew"):
        diagnose_world(job)
    assert not job.finished
    assert not list((study.root / "diagnosis").glob("*"))


def test_an_endless_diagnosis_is_stopped_and_counts(tmp_path: Path) -> None:
    study, job = study_with(tmp_path, body="import time; time.sleep(60)  # {secret} {code}")
    run = diagnose_world(Job(**{**job.__dict__, "timeout_s": 0.5}))
    assert run["exit_code"] == 124
    assert (
        "stopped after 0.5 s"
        in json.loads((study.run_folder("diagnosis", "w1") / "run.json").read_text())["output"]
    )


def double(x: int) -> int:
    if x == 3:
        raise InputError("three")
    return 2 * x


@pytest.mark.parametrize("mapping", [parallel.in_threads, parallel.in_processes])
def test_one_failure_does_not_stop_the_others(mapping: object) -> None:
    ends = list(mapping(double, [1, 2, 3], 2))  # type: ignore[operator]
    assert {d.item: d.result for d in ends if d.error is None} == {1: 2, 2: 4}
    assert [str(d.error) for d in ends if d.error is not None] == ["three"]


def test_ray_without_ray_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match="pip install 'ray"):
        list(parallel.on_ray(double, [1], 1))


def test_ray_results_and_failures_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a stand-in with Ray's calls: submission, waiting, and errors raised by `get`."""

    class RayError(Exception):
        pass

    class Task:
        def __init__(self, work: object) -> None:
            self.work = work

        def remote(self, item: int) -> tuple[object, int]:
            return (self.work, item)

    def get(reference: tuple[object, int]) -> object:
        try:
            return reference[0](reference[1])  # type: ignore[operator]
        except InputError as error:
            raise RayError(str(error)) from error

    fake = types.SimpleNamespace(
        init=lambda **options: None,
        remote=lambda **options: Task,
        wait=lambda references, num_returns: (references[:num_returns], references[num_returns:]),
        get=get,
        exceptions=types.SimpleNamespace(RayError=RayError),
    )
    monkeypatch.setitem(sys.modules, "ray", fake)
    ends = list(parallel.on_ray(double, [1, 2, 3], 2))
    assert {d.item: d.result for d in ends if d.error is None} == {1: 2, 2: 4}
    assert [str(d.error) for d in ends if d.error is not None] == ["three"]
