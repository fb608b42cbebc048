"""The commands on a study made by hand: no simulation."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.blind_test.engines.simulate import DivergedError
from samrl_core.blind_test.scores.families import ARM_FAMILIES, without
from samrl_core.blind_test.scores.study import Study
from samrl_core.blind_test.worlds import plan
from samrl_core.blind_test.worlds.plan import ForgeSettings
from samrl_core.common import executor
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_ros.blind_test import study as forge_study
from samrl_ros.cli.main import run
from samrl_ros.contract.exit_codes import FAILED, INPUT_REFUSED, OK

JOINT = "joint:panda_joint1"


def put_world(study: Study, world: str, kind: str, family: str | None, severity: float = 0.75) -> None:
    effects = [] if family is None else [
        {"family": family, "place": JOINT, "form": "T0", "severity": severity, "onset": None,
         "parameters": {}}
    ]  # fmt: skip
    label = {"schema": 1, "id": world, "set": kind, "engine": "pybullet", "arm": "tool_arm",
             "programme": 0,
             "effects": effects, "background": {"scale": 1.0}, "seed": 3}  # fmt: skip
    write_whole(study.label(world), json.dumps(label).encode())
    time = np.linspace(0, 1, 5)
    np.savez(
        study.oracle(world),
        time=time,
        effect_effort=np.full((5, 1), 0.1),
        scale_effort=np.ones(1),
        oracle_shrink=0.9,
    )
    study.observations(world).mkdir(parents=True)


def put_run(study: Study, stage: str, world: str, report: dict[str, Any] | None, code: int = 0) -> None:
    folder = study.run_folder(stage, world)
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"exit_code": code, "seconds": 3.0, "output": "boom"}))
    if report is not None:
        (folder / "report.json").write_text(json.dumps(report))
        np.savez(
            folder / "resimulation.npz",
            time=np.linspace(0, 1, 3),
            effort_measured=np.zeros((3, 1)),
            effort_nominal=np.ones((3, 1)),
            effort_with_effect=np.full((3, 1), 0.2),
        )


def claim(family: str) -> dict[str, Any]:
    named = {"family": family, "place": JOINT, "probability": 0.9, "parameters": {}}
    return {"verdict": "effect", "where": [], "unexplained_fraction": 0.1, "effects": [named]}


@pytest.fixture
def study(tmp_path: Path) -> Study:
    made = Study(tmp_path / "study")
    put_world(made, "w000", "single", "coulomb_friction")
    put_world(made, "w001", "none", None)
    put_world(made, "w002", "outside", "hum")
    put_world(made, "w003", "single", "payload")
    put_world(made, "w004", "single", "coulomb_friction")
    made.seal([f"w00{k}" for k in (2, 0, 4, 1, 3)], {"seed": 2**40, "commit": None})
    put_run(made, "diagnosis", "w000", claim("coulomb_friction"))
    put_run(made, "diagnosis", "w001", {"verdict": "no_gap", "effects": []})
    put_run(made, "diagnosis", "w002", {"verdict": "none_of_mine", "unexplained_fraction": 0.8})
    put_run(made, "diagnosis", "w003", None, code=1)
    put_run(made, "diagnosis", "w004", claim("viscous_friction"))
    put_run(made, "baselines/argmin_rmse", "w000", claim("payload"))
    return made


def test_score_writes_json_page_and_pictures(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["forge", "score", str(study.root)]) == OK
    content = json.loads((study.root / "score.json").read_text())
    scores = content["scores"]
    assert (scores["which"]["top1_family"]["successes"], scores["which"]["top1_family"]["trials"]) == (1, 3)
    assert scores["refusal"]["unknown_rejected"]["value"] == 1.0
    assert scores["how_far"]["named_right"]["ratio"]["median"] == pytest.approx(0.8 / 0.9)
    assert scores["how_far"]["all"]["ratio"]["n"] == 3  # the crashed one as well
    assert [row["name"] for row in scores["baselines"]] == ["diagnosis, 1 worlds", "argmin_rmse"]
    assert scores["baselines"][0]["top1_family"]["value"] == 1.0
    assert scores["baselines"][1]["top1_family"]["value"] == 0.0
    assert content["forge"]["sealed_sha256"] == study.published()["sealed_sha256"]
    assert {w["id"]: w["verdict"] for w in content["worlds"]}["w003"] == "crashed"
    assert (study.root / "score.html").stat().st_size > 10_000
    assert (study.root / "score_severity.png").read_bytes()[:4] == b"\x89PNG"
    assert "family right" in capsys.readouterr().out


def test_score_refuses_a_changed_seal(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    study.tar.write_bytes(study.tar.read_bytes() + b"\0")
    assert run(["forge", "score", str(study.root)]) == INPUT_REFUSED
    assert "was published" in capsys.readouterr().err
    assert not (study.root / "score.json").exists()


def test_score_refuses_unfinished_worlds_unless_told(study: Study) -> None:
    (study.run_folder("diagnosis", "w000") / "run.json").unlink()
    assert run(["forge", "score", str(study.root)]) == INPUT_REFUSED
    assert run(["forge", "score", str(study.root), "--unfinished"]) == OK


def test_withheld_worlds_are_scored_apart(study: Study) -> None:
    chosen = forge_study.left_out(study, 2)
    assert chosen == {"w000": "coulomb_friction", "w003": "payload"}  # one of each family first
    assert forge_study.left_out(study, 2) == chosen
    put_run(study, "left_out", "w000", {"verdict": "none_of_mine", "unexplained_fraction": 0.5})
    put_run(study, "left_out", "w003", claim("coulomb_friction"))
    assert run(["forge", "score", str(study.root)]) == OK
    refusal = json.loads((study.root / "score.json").read_text())["scores"]["refusal"]
    assert (refusal["left_out_rejected"]["successes"], refusal["left_out_rejected"]["trials"]) == (1, 2)


def test_a_folder_belongs_to_one_forge(tmp_path: Path) -> None:
    study = Study(tmp_path / "new")
    forge_study.same_as_before(study, {"settings": {"seed": 1}, "commit": "abc"})
    forge_study.same_as_before(study, {"settings": {"seed": 1}, "commit": "abc"})
    assert forge_study.commit_before(study) == "abc"
    with pytest.raises(InputError, match="other settings"):
        forge_study.same_as_before(study, {"settings": {"seed": 2}, "commit": "abc"})
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        forge_study.same_as_before(Study(tmp_path / "full"), {})


@pytest.mark.parametrize("worlds", [1, 3, 4, 10, 37, 300, 1000])
def test_shares_sum_up(worlds: int) -> None:
    counts = forge_study.shares(worlds, asdict(ForgeSettings()))
    assert sum(counts[k] for k in ("single", "none", "outside", "double")) == worlds
    if worlds == 300:
        usual = ForgeSettings()
        assert (counts["single"], counts["none"]) == (usual.single, usual.none)


class Planned(Exception):
    """Ends the command where worlds would be made."""


@pytest.fixture
def planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., ForgeSettings]:
    """Settings that a command line comes to, in a folder that they begin."""

    def stop(settings: ForgeSettings) -> None:
        raise Planned(settings)

    def settings_of(*options: str) -> ForgeSettings:
        with monkeypatch.context() as patch:
            patch.setattr(plan, "plan_worlds", stop)
            with pytest.raises(Planned) as found:
                run(["forge", "--out", str(tmp_path / "study"), "--seed", "1", *options])
        return found.value.args[0]

    return settings_of


@pytest.mark.parametrize(
    ("options", "single", "none", "outside", "double", "mujoco", "pinocchio"),
    [
        ("", 174, 60, 42, 24, 100, 100),
        ("--worlds 300", 174, 60, 42, 24, 100, 100),
        ("--worlds 30", 18, 6, 4, 2, 10, 10),
        ("--single 29 --none 0 --outside 0 --double 0", 29, 0, 0, 0, 10, 10),
        ("--single 1 --none 0 --outside 0 --double 0", 1, 0, 0, 0, 0, 0),
        ("--single 29 --none 0 --outside 0 --double 0 --mujoco 29", 29, 0, 0, 0, 29, 0),
        ("--family payload", 6, 2, 0, 0, 3, 3),
        ("--effect payload --effect backlash", 12, 4, 0, 2, 6, 6),
        ("--family soft_stop", 0, 1, 4, 0, 2, 2),
        ("--family magnet", 0, 1, 4, 0, 2, 2),
        ("--family payload --worlds 10", 8, 2, 0, 0, 3, 3),
        ("--family payload --single 3 --none 0 --pinocchio 0", 3, 0, 0, 0, 1, 0),
    ],
)
def test_counts_that_are_not_given_follow(
    planned: Any, options: str, single: int, none: int, outside: int, double: int, mujoco: int, pinocchio: int
) -> None:
    s = planned(*options.split())
    assert (s.single, s.none, s.outside, s.double) == (single, none, outside, double)
    assert (s.mujoco, s.pinocchio) == (mujoco, pinocchio)


def test_an_unfinished_study_goes_on_as_it_began(planned: Callable[..., ForgeSettings]) -> None:
    only = "--single 29 --none 0 --outside 0 --double 0".split()
    assert planned(*only, "--mujoco", "20").mujoco == 20
    assert planned(*only).mujoco == 20


def test_a_study_of_some_families_holds_no_others() -> None:
    names = ("payload", "backlash", "soft_stop")
    settings = ForgeSettings(1, single=12, none=1, outside=3, double=6, mujoco=0, pinocchio=0, families=names)
    made = plan.plan_worlds(settings)
    assert {e.family for item in made for e in item.effects} == set(names)
    assert {e.family for item in made if item.set == "outside" for e in item.effects} == {"soft_stop"}
    assert "families" not in ForgeSettings().as_dict() and settings.as_dict()["families"] == names


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ("--family payloat", "no family 'payloat' can be made; there are"),
        ("--family payload --double 2", "2 double worlds need 2 families"),
        ("--family payload --outside 1", "1 outside worlds need 1 family"),
        (
            "--single 3 --none 0 --outside 0 --double 0 --mujoco 4",
            "4 worlds by MuJoCo and 0 by Pinocchio of 3",
        ),
        ("--family magnet --no-second-set", "no family 'magnet' can be made; there are"),
    ],
)
def test_counts_that_cannot_be_are_refused(
    options: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["forge", "--out", str(tmp_path / "study"), "--seed", "1", *options.split()]) == 3
    assert why in " ".join(capsys.readouterr().err.split()) and not (tmp_path / "study").exists()


def test_seed_comes_from_the_commit_unless_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: (_ for _ in ()).throw(OSError("no git")))
    with pytest.raises(InputError, match="--seed or --commit"):
        forge_study.head()


def test_libraries_withhold_exactly_one_family() -> None:
    assert Counter(ARM_FAMILIES).most_common(1)[0][1] == 1
    assert len(ARM_FAMILIES) >= 30
    assert set(ARM_FAMILIES) - set(without("backlash")) == {"backlash"}


def test_sweeping_leaves_finished_worlds(study: Study) -> None:
    half = study.root / "obs" / ".w009.77"
    half.mkdir()
    (half / "A.mcap").write_text("half")
    study.sweep("obs")
    assert not half.exists()
    assert study.made("w000")


def _forging(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, asked: list[str], broken: list[str]
) -> list[str]:
    """The command for four worlds, of which those in `broken` fail with `error`."""

    def pretend(work: object, items: list[Any], workers: int) -> Iterator[executor.Done]:
        for k, item in enumerate(items):
            asked.append(item.item.id)
            if item.item.id in broken:
                yield executor.Done(k, item, error=error)
                continue
            put_world(Study(item.root), item.item.id, "none", None)
            yield executor.Done(k, item, 1.0)

    monkeypatch.setattr(executor, "run_in_processes", pretend)
    return ["forge", "--out", str(tmp_path / "s"), "--seed", "4711", "--single", "2", "--none", "2",
            "--outside", "0", "--double", "0", "--mujoco", "0"]  # fmt: skip


def test_a_world_that_runs_away_is_left_out_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = _forging(tmp_path, monkeypatch, DivergedError("lag 9.99 rad"), [], ["w001"])
    assert run(command) == OK
    assert "ran away" in capsys.readouterr().out
    published = Study(tmp_path / "s").published()
    assert published["ran_away"] == ["w001"]
    assert sorted(published["worlds"]) == ["w000", "w002", "w003"]


def test_a_world_that_fails_stops_no_other_and_nothing_is_sealed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []
    broken = ["w001"]
    command = _forging(tmp_path, monkeypatch, OSError("no space left"), asked, broken)
    assert run(command) == FAILED
    said = capsys.readouterr().out
    assert "w001" in said and "no space left" in said and "nothing is sealed" in said
    assert len(asked) == 4 and not Study(tmp_path / "s").forge_file.exists()
    broken.clear()
    assert run(command) == OK
    assert asked[4:] == ["w001"]
    assert "4711" not in Study(tmp_path / "s").forge_file.read_text()  # the seed is sealed, not published
    assert '"seed": 4711' in Study(tmp_path / "s").plan.read_text()
