"""A servo world on disk: what its user's import takes, in CSV and as a bag, and the steps of a diagnosis."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.blind_test.scores.diagnosis_run import DiagnosisJob, diagnose_world
from samrl_core.blind_test.scores.outcome import SealedTruth
from samrl_core.blind_test.scores.study import Study
from samrl_core.blind_test.servo_worlds import world
from samrl_core.blind_test.servo_worlds.log_style import Style, choose_style
from samrl_core.blind_test.servo_worlds.plan import ServoEffect, ServoItem
from samrl_ros.blind_test.servo_runs import ServoMaking, csv_text, make_servo

EFFECT = ServoEffect("viscous_friction", "joint:swing", 0, "T0", 0.5)
ITEM = ServoItem("s000", "single", "pendulum", "position_servo", (EFFECT,), 11, 1.6)
SCRIPT = (
    "import pathlib, sys\n"
    "step = sys.argv[1]\n"
    "assert pathlib.Path('mapping.yaml').exists() and pathlib.Path('model.urdf').exists()\n"
    "if step == 'import':\n"
    "    [pathlib.Path(f'{x}.mcap').write_text(x) for x in 'ABC']\n"
    "elif step == 'refuse':\n"
    "    sys.exit(3)\n"
    "else:\n"
    "    out = pathlib.Path('out'); out.mkdir()\n"
    "    (out / 'report.json').write_text('{\"verdict\": \"no_gap\"}')\n"
)


def _styled(monkeypatch: pytest.MonkeyPatch, **habits: object) -> None:
    def choose(*asked: object) -> Style:
        return replace(choose_style(*asked), **habits)

    monkeypatch.setattr(world, "choose_style", choose)


@pytest.mark.parametrize("bag", [False, True])
def test_a_stand_in_is_written_as_its_user_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bag: bool
) -> None:
    plain = {
        "every": 1,
        "in_counts": False,
        "degrees": False,
        "time_unit": "s",
        "velocity": True,
        "effort": "torque",
    }
    _styled(monkeypatch, bag=bag, **plain)
    study = Study(tmp_path)
    make_servo(ServoMaking(tmp_path, ITEM))
    folder = study.observations("s000")
    ending = "mcap" if bag else "csv"
    assert {f.name for f in folder.iterdir()} == {
        "mapping.yaml", "model.urdf", *(f"log_{x}.{ending}" for x in "ABC"),
    }  # fmt: skip
    mapping = yaml.safe_load((folder / "mapping.yaml").read_text())
    assert mapping["controller"]["type"] == "position_servo"
    label = json.loads(study.label("s000").read_text())
    truth = SealedTruth.from_label(label)
    assert truth.names == ("viscous_friction@joint:swing",) and truth.series == "servo worlds"
    told = (folder / "mapping.yaml").read_text() + (folder / "model.urdf").read_text()
    assert "viscous_friction@" not in told and "seed" not in told
    # The importer reads back what the engine made; the kind of controller is another part's business.
    del mapping["controller"]
    (folder / "plain.yaml").write_text(yaml.safe_dump(mapping))
    from samrl_ros.cli.main import run
    from samrl_ros.recordings.read import read_recordings

    assert run(["bag", "import", str(folder / "plain.yaml"), "--out", str(tmp_path / "bags")]) == 0
    (read,) = read_recordings(tmp_path / "bags" / "B.mcap")
    table = world.make_servo_world(ITEM).tables["B"]
    assert read.states.position is not None and read.commanded_effort is not None
    assert np.allclose(read.states.position[:, 0], table["pos_swing"], atol=1e-6)
    assert np.allclose(read.commanded_effort.effort[:, 0], table["torque_swing"], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("first", "code"), [("import", 0), ("refuse", 3)])
def test_logs_are_imported_before_they_are_diagnosed(tmp_path: Path, first: str, code: int) -> None:
    make_servo(ServoMaking(tmp_path, ITEM))
    script = tmp_path.parent / f"{tmp_path.name}_step.py"
    script.write_text(SCRIPT)
    step = (sys.executable, str(script))
    run = diagnose_world(DiagnosisJob(tmp_path, "s000", command=(*step, "diagnose"), importer=(*step, first)))
    assert run["exit_code"] == code
    assert (Study(tmp_path).run_folder("diagnosis", "s000") / "report.json").exists() == (code == 0)


def test_a_decimal_comma_needs_another_separator() -> None:
    text = csv_text({"time": np.array([0.0, 0.5]), "pos": np.array([1e-7, -2.25])}, ";", ",")
    assert text == "time;pos\n0;1e-07\n0,5;-2,25\n"
