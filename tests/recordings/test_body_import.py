"""Tracks of bodies by a mapping alone, to files and to a report by the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.recordings.body_file import read_body_file
from tests.diagnosis.bodies.body_worlds import Tracker, World, several, slide, toss

NAMES = "ms,x,y,z,qw,qx,qy,qz"


def mapping() -> dict:
    return {
        "sources": {
            "tag": {
                "time": {"column": "ms", "unit": "ms"},
                "columns": {name: name for name in NAMES.split(",")[1:]},
            }
        },
        "bodies": {
            "body": {"name": "cube", "box": [100, 100, 100], "unit": "mm", "mass": 0.37},
            "track": {
                "position": ["x", "y", "z"], "unit": "mm", "quaternion": ["qw", "qx", "qy", "qz"],
                "order": "wxyz",
            },
        },
        "recordings": [{"glob": "tosses/*.csv"}],
    }  # fmt: skip


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    (tmp_path / "tosses").mkdir()
    for recording in several(toss, World(gravity=(0.5, 0.0, -9.8)), 6, 3):
        t = recording.track
        table = np.column_stack([1e3 * t.time, 1e3 * t.position, t.quat_xyzw[:, [3, 0, 1, 2]]])
        np.savetxt(
            tmp_path / "tosses" / f"{recording.name}.csv", table, delimiter=",", header=NAMES, comments=""
        )
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(mapping()))
    return tmp_path


def imported(folder: Path, content: dict) -> BodyRecording:
    (folder / "mapping.yaml").write_text(yaml.safe_dump(content))
    return import_any(folder / "mapping.yaml", folder, None).made[0].recording


def test_a_mapping_alone_gives_a_report(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert import_any(logs / "mapping.yaml", logs, None).kind == "bodies"
    assert run(["bag", "import", str(logs / "mapping.yaml"), "--check"]) == 0
    assert "flight 0.000 .." in capsys.readouterr().out and not (logs / "bags").exists()
    assert run(["bag", "import", str(logs / "mapping.yaml"), "--out", str(logs / "bags")]) == 0
    assert run(["diagnose", str(logs / "bags"), "--out", str(logs / "report")]) == 0
    report = json.loads((logs / "report" / "report.json").read_text())
    assert report["verdict"] == "effect"
    assert [f"{e['family']}@{e['place']}" for e in report["effects"]] == ["base_tilt@cell"]
    assert [i["role"] for i in report["inputs"]] == ["fit"] * 4 + ["held_out"] * 2
    assert (logs / "report" / "summary.png").stat().st_size > 10_000
    both = [str(logs / "bags" / "run00.body.npz"), "--held-out", str(logs / "bags" / "run00.body.npz")]
    assert run(["diagnose", *both, "--out", str(logs / "again")]) == 3


def test_files_hold_what_was_imported(logs: Path) -> None:
    made = import_any(logs / "mapping.yaml", logs, logs / "bags").made
    assert [m.role for m in made] == ["fit", "held_out", "fit", "fit", "held_out", "fit"]
    a, b = made[0].recording, read_body_file(logs / "bags" / "run00.body.npz")
    assert np.array_equal(a.track.position, b.track.position)
    assert np.array_equal(a.track.quat_xyzw, b.track.quat_xyzw) and a.track.turns == b.track.turns == "xyz"
    assert (a.body, a.support, a.gravity, a.tolerances) == (b.body, b.support, b.gravity, b.tolerances)
    assert a.body.sizes == pytest.approx((0.1, 0.1, 0.1))
    with pytest.raises(InputError, match="exists already"):
        import_any(logs / "mapping.yaml", logs, logs / "bags")
    content = (logs / "bags" / "run00.body.npz").read_bytes()
    (logs / "cut.body.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError):
        read_body_file(logs / "cut.body.npz")


def test_a_planar_track_on_an_incline(tmp_path: Path) -> None:
    angle, g = np.deg2rad(25.0), 9.81
    world = World(
        gravity=(g * np.sin(angle), 0.0, -g * np.cos(angle)), friction=0.2, tracker=Tracker(rate=60.0)
    )
    for recording in several(slide, world, 4, 1, way=0.0, speed=0.4, seconds=0.8):
        t = recording.track
        table = np.column_stack([t.time, 1e2 * t.position[:, :2], 0.0 * t.time])
        np.savetxt(tmp_path / f"{recording.name}.csv", table, delimiter=",", header="t,u,v,a", comments="")
    content = {
        "sources": {"video": {"time": {"column": "t"}, "columns": {"u": "u", "v": "v", "a": "a"}}},
        "bodies": {
            "track": {"position": ["u", "v"], "axes": "xy", "unit": "cm", "angle": "a"},
            "support": {"friction": 0.2},
            "incline": 25,
        },
        "recordings": [{"glob": "*.csv", "hold_out_every": 2}],
    }
    recording = imported(tmp_path, content)
    assert recording.gravity == pytest.approx(world.gravity) and recording.track.turns == "z"
    assert run(["bag", "import", str(tmp_path / "mapping.yaml"), "--out", str(tmp_path / "bags")]) == 0
    assert run(["diagnose", str(tmp_path / "bags"), "--out", str(tmp_path / "report")]) == 0
    assert json.loads((tmp_path / "report" / "report.json").read_text())["verdict"] == "no_gap"


@pytest.mark.parametrize(
    "change, message",
    [
        ({"track": {"position": ["x", "y"]}}, "2 numbers per sample for the axes 'xyz'"),
        ({"track": {"position": ["x", "y", "z"], "angle": "x"}}, "must be two"),
        ({"track": {"position": ["x", "y", "z"], "quaternion": ["x", "y", "z", "qw"]}}, "must be 1"),
        ({"track": {"position": ["x", "y", "z"], "unit": "m"}}, "m/s .median.*look for the `unit`"),
        ({"body": {"sphere": 0.1, "box": [1, 1, 1]}}, "one shape"),
        ({"body": {"sphere": -0.1}}, "must be > 0"),
        ({"support": {"friction": -1}}, "must be 0 to 5"),
        ({"support": {"normal": [0, 0, 0]}}, "normal not 0"),
        ({"incline": 20}, "state `support`"),
        ({"gravity": [0, 0, 0]}, "must be finite and not zero"),
        ({"phase": "slide"}, "must be one of"),
        ({"phase": "contact"}, "needs `support`"),
    ],
)
def test_bad_mappings_name_the_key(logs: Path, change: dict, message: str) -> None:
    content = mapping()
    content["bodies"] |= change
    with pytest.raises(InputError, match=message) as caught:
        imported(logs, content)
    assert "recordings[0]" in str(caught.value)


@pytest.mark.parametrize(
    "entry, message",
    [
        ({"glob": "nothing/*.csv"}, "no file"),
        ({"glob": "../*.csv"}, "below the folder"),
        ({"glob": "tosses/*.csv", "hold_out_every": 1}, "must be 2 or more"),
        ({"name": "run00", "hold_out_every": 2}, "goes with `glob`"),
    ],
)
def test_bad_patterns_are_refused(logs: Path, entry: dict, message: str) -> None:
    content = mapping()
    content["recordings"] = [entry]
    with pytest.raises(InputError, match=message):
        imported(logs, content)


@pytest.mark.parametrize(
    "key, says", [("files", "glob names the files"), ("parts", r"parts: no source \['nobody'\]; there are")]
)
def test_a_source_that_is_not_there_is_named(logs: Path, key: str, says: str) -> None:
    (logs / "bad.yaml").write_text(yaml.safe_dump({**mapping(), key: {"nobody": "x.csv"}}))
    with pytest.raises(InputError, match=rf"recordings\[0\]\.{says}"):
        import_any(logs / "bad.yaml", logs, None)


def test_a_ball_that_is_braked_on_its_way_has_friction_and_no_negative_inertia(tmp_path: Path) -> None:
    """Six balls roll on a level table; the stated coefficient of rolling is 0.005, the true one 0.012."""
    rng = np.random.default_rng(4)
    time = np.arange(0, 2.5, 1 / 60)
    for k in range(6):
        brake = 0.012 * 9.81 / 1.4  # a solid ball's inertia takes part
        speed, way = rng.uniform(0.4, 0.9), rng.uniform(0, 2 * np.pi)
        rolled = np.minimum(time, speed / brake)
        path = np.outer(speed * rolled - 0.5 * brake * rolled**2, [np.cos(way), np.sin(way)])
        table = np.column_stack([time, path + 4e-4 * rng.standard_normal(path.shape)])
        np.savetxt(tmp_path / f"roll{k}.csv", table, delimiter=",", header="t,x,y", comments="")
    support = {"rolls": True, "friction": 0.005}
    content = {
        "sources": {"log": {"time": {"column": "t"}, "columns": {"x": "x", "y": "y"}}},
        "bodies": {
            "body": {"name": "ball", "sphere": 0.03},
            "track": {"position": ["x", "y"], "axes": "xy"},
            "support": support,
        },
        "recordings": [{"glob": "roll*.csv"}],
    }
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(content))
    assert run(["bag", "import", str(tmp_path / "mapping.yaml"), "--out", str(tmp_path / "bags")]) == 0
    assert run(["diagnose", str(tmp_path / "bags"), "--out", str(tmp_path / "report")]) == 0
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert report["verdict"] == "effect"
    assert [e["family"] for e in report["effects"]] == ["contact_friction"]
    low, high = report["effects"][0]["parameters"]["mu"]["ci95"]
    assert low < 0.012 < high
