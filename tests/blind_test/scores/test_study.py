from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from samrl_core.blind_test.scores.load import load_outcomes
from samrl_core.blind_test.scores.study import Study, move_folder
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole


def label(world: str, kind: str = "none") -> dict[str, object]:
    return {"schema": 1, "id": world, "set": kind, "engine": "pybullet", "arm": "tool_arm", "programme": 0,
            "effects": [], "background": {"scale": 1.0}, "seed": 3}  # fmt: skip


@pytest.fixture
def study(tmp_path: Path) -> Study:
    made = Study(tmp_path / "study")
    for world in ("b1", "a0"):
        write_whole(made.label(world), json.dumps(label(world)).encode())
        made.observations(world).mkdir(parents=True)
    np.savez(made.oracle("a0"), time=np.arange(3.0), oracle_shrink=0.5)
    made.seal(["b1", "a0"], {"seed": 1})
    return made


def put_run(study: Study, world: str, code: int, report: str | None) -> None:
    folder = study.run_folder("diagnosis", world)
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"exit_code": code, "seconds": 4.0, "output": "Traceback"}))
    if report is not None:
        (folder / "report.json").write_text(report)


def test_sealing_twice_gives_the_same_hash(study: Study) -> None:
    first = study.published()
    assert study.seal(["b1", "a0"], {"seed": 1}) == first
    assert first["worlds"] == ["b1", "a0"]  # the shuffled order is kept


def test_labels_come_from_the_seal_alone(study: Study) -> None:
    study.label("a0").write_text(json.dumps(label("a0", "single")))
    sealed = study.open_seal()
    assert sealed.labels()["a0"]["set"] == "none"
    oracle = sealed.oracle("a0")
    assert oracle is not None
    assert oracle["oracle_shrink"] == 0.5
    assert sealed.oracle("b1") is None


def test_a_changed_seal_is_refused(study: Study) -> None:
    content = study.tar.read_bytes()
    study.tar.write_bytes(content.replace(b'"none"', b'"nono"'))
    with pytest.raises(InputError, match="was published"):
        study.open_seal()


def test_no_seal_and_no_tar_are_refused(study: Study, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not sealed"):
        Study(tmp_path / "other").open_seal()
    study.tar.unlink()
    with pytest.raises(InputError, match="does not exist"):
        study.open_seal()


def test_crashes_count_and_unfinished_worlds_are_refused_or_count(study: Study) -> None:
    put_run(study, "a0", 1, '{"verdict": "no_gap"}')  # a report beside a failed exit does not count
    with pytest.raises(InputError, match="1 of 2 worlds"):
        load_outcomes(study, study.open_seal(), "diagnosis", ["b1", "a0"])
    outcomes = load_outcomes(study, study.open_seal(), "diagnosis", ["b1", "a0"], unfinished=True)
    assert [o.verdict for o in outcomes] == ["crashed", "crashed"]
    assert outcomes[1].seconds == 4.0


def test_an_unreadable_report_is_a_crash(study: Study) -> None:
    put_run(study, "a0", 0, '{"verdict": ')
    put_run(study, "b1", 0, '{"verdict": "no_gap"}')
    outcomes = load_outcomes(study, study.open_seal(), "diagnosis", ["b1", "a0"])
    assert [o.verdict for o in outcomes] == ["no_gap", "crashed"]


def test_an_unknown_world_is_refused(study: Study) -> None:
    with pytest.raises(InputError, match="no sealed label"):
        load_outcomes(study, study.open_seal(), "diagnosis", ["zz"])


def test_a_folder_replaces_what_a_killed_run_left(tmp_path: Path) -> None:
    (tmp_path / "target").mkdir()
    (tmp_path / "target" / "half").write_text("x")
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "whole").write_text("y")
    move_folder(tmp_path / "source", tmp_path / "target")
    assert [p.name for p in (tmp_path / "target").iterdir()] == ["whole"]
