"""`samrl diagnose --mapping FILE [LOG...]`: logs read as a mapping says, without bags between."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.cli.main import run
from samrl_ros.recordings.described import model_of
from tests.diagnosis.bodies.body_worlds import World, several, slide
from tests.recordings.logs.made_logs import JOINTS, MOTION, by_joint, urdf_of, write_csv


def log(path: Path, factor: float = 1.0) -> Path:
    """Columns that nothing but a mapping explains."""
    path.parent.mkdir(exist_ok=True)
    columns = {"n": np.arange(len(MOTION.time)), **by_joint("u_{}", factor * MOTION.position, JOINTS)}
    return write_csv(path, {**columns, **by_joint("v_{}", MOTION.effort, JOINTS)})


def mapping_at(folder: Path, **changes: Any) -> Path:
    content = {
        "joints": list(JOINTS),
        "urdf": urdf_of(JOINTS),
        "controller": {"stiffness": [90.0] * 3, "damping": [9.0] * 3},
        "tolerances": {"mass": 0.07},
        "sources": {
            "log": {"file": "day.csv", "time": {"rate_hz": 100.0}, "columns": {
                **{f"q{k}": f"u_{name}" for k, name in enumerate(JOINTS)},
                **{f"m{k}": f"v_{name}" for k, name in enumerate(JOINTS)},
            }}
        },
        "channels": {
            "states": {"position": ["q0", "q1", "q2"], "velocity": "derivative"},
            "commanded_effort": {"effort": ["m0", "m1", "m2"]},
        },
        "recordings": [{"name": "day"}],
    }  # fmt: skip
    path = folder / "mapping.yaml"
    path.write_text(yaml.safe_dump({**content, **changes}))
    return path


def arms(options: DiagnoseOptions) -> tuple[list[ArmRecording], list[ArmRecording]]:
    fit, held_out, _ = load(options, model_of(options.urdf) if options.urdf else None)
    assert all(isinstance(r, ArmRecording) for r in (*fit, *held_out))
    return list(fit), list(held_out)  # ty: ignore[invalid-explicit-return]


def test_logs_take_the_place_of_those_that_a_mapping_names(tmp_path: Path) -> None:
    logs = tuple(log(tmp_path / "elsewhere" / f"{name}.csv", 1.0 + 0.1 * k) for k, name in enumerate("abc"))
    mapping = mapping_at(tmp_path)
    fit, held_out = arms(DiagnoseOptions(logs, mapping=mapping))
    assert [r.name for r in fit] == ["a", "b"] and [r.name for r in held_out] == ["c"]
    np.testing.assert_allclose(fit[1].states.position, 1.1 * MOTION.position, atol=1e-12)
    assert fit[0].arm.tolerances.mass == 0.07 and fit[0].arm.controller is not None
    fit, held_out = arms(DiagnoseOptions(logs[1:], held_out=logs[:1], mapping=mapping))
    assert [r.name for r in fit] == ["b", "c"] and [r.name for r in held_out] == ["a"]


def test_a_mapping_alone_reads_its_own_recordings(tmp_path: Path) -> None:
    log(tmp_path / "logs" / "day.csv")
    fit, held_out = arms(DiagnoseOptions(mapping=mapping_at(tmp_path), data=tmp_path / "logs"))
    assert len(fit) == len(held_out) == 1 and fit[0].name.startswith("day")
    assert len(fit[0].states.time) + len(held_out[0].states.time) < len(MOTION.time)


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    logs = tuple(
        log(tmp_path / day / "run.csv", 1.0 + 0.1 * k) for k, day in enumerate(("monday", "tuesday"))
    )
    fit, held_out = arms(DiagnoseOptions(logs, mapping=mapping_at(tmp_path)))
    assert fit[0].name == "monday_run" and held_out[0].name == "tuesday_run"


def test_model_and_tolerances_of_the_command_line_come_before_the_mappings(tmp_path: Path) -> None:
    logs = tuple(log(tmp_path / f"{name}.csv", 1.0 + 0.1 * k) for k, name in enumerate("ab"))
    (tmp_path / "other.urdf").write_text(urdf_of(JOINTS).replace('name="r"', 'name="other"'))
    (tmp_path / "t.yaml").write_text("mass: 0.2\n")
    options = DiagnoseOptions(
        logs, mapping=mapping_at(tmp_path), urdf=tmp_path / "other.urdf", tolerances=tmp_path / "t.yaml"
    )
    (fit,), _ = arms(options)
    assert fit.arm.urdf is not None and 'name="other"' in fit.arm.urdf
    assert fit.arm.tolerances.mass == 0.2
    (tmp_path / "other.urdf").write_text(urdf_of(("x", *JOINTS[1:])))
    with pytest.raises(InputError, match=r"lacks \['shoulder'\]"):
        arms(options)


def test_readings_by_mapping_have_a_part_held_out(tmp_path: Path) -> None:
    true = np.repeat(np.linspace(0.4, 1.6, 20), 20)
    write_csv(tmp_path / "x.csv", {"zz": 1.02 * true, "ll": true})
    source = {"file": "other.csv", "columns": {"z": "zz", "l": "ll"}}
    content = {
        "readings": {"quantity": "depth", "reading": "z", "reference": "l"},
        "sources": {"log": source},
    }
    path = tmp_path / "depth.yaml"
    path.write_text(yaml.safe_dump({**content, "recordings": [{"name": "other"}]}))
    fit, held_out, _ = load(DiagnoseOptions((tmp_path / "x.csv",), mapping=path))
    assert isinstance(fit[0], ReadingRecording) and isinstance(held_out[0], ReadingRecording)
    assert len(fit[0].reading) + len(held_out[0].reading) <= len(true)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"recordings": [{"name": "day", "rows": [0, 100]}]}, "rows cut its recordings"),
        ({"recordings": [{"name": "a"}, {"name": "b", "arm": "camera_arm"}]}, "differ in arm"),
        ({"sources": {"one": {}, "two": {}}}, "has sources one, two"),
        ({"recordings": 3}, "a list `recordings`"),
        ({"questions": ["which unit?"]}, "questions of its draft are open"),
    ],
)
def test_mappings_that_no_log_can_be_put_into(tmp_path: Path, changes: dict[str, Any], part: str) -> None:
    with pytest.raises(InputError, match=part):
        arms(DiagnoseOptions((log(tmp_path / "a.csv"),), mapping=mapping_at(tmp_path, **changes)))


def test_what_options_do_not_go_with_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mapping, path = str(mapping_at(tmp_path)), str(log(tmp_path / "a.csv"))
    out = ["--out", str(tmp_path / "report")]
    for arguments, part in (
        ([path, "--mapping", mapping, "--effort", "link"], "its channels say what efforts are"),
        ([path, "--mapping", mapping, "--camera"], "leave out --mapping"),
        (["--mapping", mapping, "--watch"], "leave out bags, --mapping, --camera"),
        ([path, "--sim", path, "--mapping", mapping], "samrl bag import"),
        ([path, "--data", str(tmp_path)], "without --mapping FILE nothing comes of --data"),
        ([path, "--randomise"], "without --export TARGET nothing comes of --randomise"),
        ([path, "--windows", "3", "--keep", "2"], "without --watch nothing comes of --windows, --keep"),
        (["--many", str(tmp_path), "--camera", "--apply"], "leave out --camera, --apply"),
        ([str(tmp_path / "none.csv"), "--mapping", mapping], "does not exist"),
        (["--mapping", str(tmp_path / "none.yaml")], "none.yaml"),
    ):
        assert run(["diagnose", *arguments, *out]) == 3
        assert part in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "report").exists()


def test_a_note_names_its_recording_once(tmp_path: Path) -> None:
    """Tracks of bodies name it themselves."""
    for made in several(slide, World(), 2, 1):
        position, time = made.track.position, made.track.time
        columns = {"t": time, "x": position[:, 0], "y": position[:, 1]}
        write_csv(tmp_path / f"{made.name}.csv", columns)
    content = {
        "sources": {"log": {"time": {"column": "t"}, "columns": {"x": "x", "y": "y"}}},
        "bodies": {"track": {"position": ["x", "y"], "axes": "xy"}, "support": {"friction": 0.3}},
        "recordings": [{"glob": "*.csv"}],
    }
    mapping = tmp_path / "m.yaml"
    mapping.write_text(yaml.safe_dump(content))
    *_, notes = load(DiagnoseOptions(mapping=mapping))
    assert any(note.startswith("run00: ") for note in notes)
    assert not any(note.startswith("run00: run00: ") for note in notes)
