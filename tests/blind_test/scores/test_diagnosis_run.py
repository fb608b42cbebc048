from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import yaml

from samrl_core.blind_test.scores.diagnosis_run import DiagnosisJob, can_hide, diagnose_world
from samrl_core.blind_test.scores.load import read_report
from samrl_core.blind_test.scores.study import Study
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


def study_with(tmp_path: Path, code: int = 0, body: str = SPY) -> tuple[Study, DiagnosisJob]:
    study = Study(tmp_path / "study")
    study.observations("w1").mkdir(parents=True)
    for part in "ABC":
        (study.observations("w1") / f"{part}.mcap").write_text(part)
    (study.root / "sealed").mkdir()
    study.label("w1").write_text("secret")
    script = tmp_path / "spy.py"
    script.write_text(body.format(secret=str(study.label("w1")), code=code))
    return study, DiagnosisJob(study.root, "w1", command=(sys.executable, str(script)), timeout_s=PATIENCE_S)


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
    diagnose_world(DiagnosisJob(**{**job.__dict__, "stage": "left_out", "library": ("payload", "cable")}))
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
    run = diagnose_world(DiagnosisJob(**{**job.__dict__, "timeout_s": 0.5}))
    assert run["exit_code"] == 124
    assert (
        "stopped after 0.5 s"
        in json.loads((study.run_folder("diagnosis", "w1") / "run.json").read_text())["output"]
    )
