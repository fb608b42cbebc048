"""`samrl diagnose LOG...` of poses, depth and stamps of other tools: a report, or questions and a command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from samrl_ros.cli.diagnosis.load import load
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.cli.main import run
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.foreign import runs_in
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping
from tests.recordings.draft.test_pose_draft import opencv, two_files
from tests.recordings.draft.test_pose_draft import ros2_bag as pose_bag
from tests.recordings.logs.made_logs import JOINTS, MOTION, by_joint, ros2_bag, urdf_of, write_csv


def write_columns(path: Path, **columns: np.ndarray) -> Path:
    np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header=",".join(columns),
               comments="", fmt="%.9f")  # fmt: skip
    return path


def depth_log(path: Path, seed: int, factor: float = 1.0) -> Path:
    rng = np.random.default_rng(seed)
    true = np.repeat([0.4, 0.7, 1.0, 1.3, 1.6], 40)
    depth = factor * true * (1.0 + 0.001 * rng.standard_normal(len(true)))
    return write_columns(path, depth_mm=1e3 * depth, laser_distance_mm=1e3 * true)


def test_depth_against_a_laser_needs_no_mapping(tmp_path: Path) -> None:
    fit, held = depth_log(tmp_path / "a.csv", 1, 1.02), depth_log(tmp_path / "b.csv", 2, 1.02)
    report = tmp_path / "report"
    assert run(["diagnose", str(fit), "--held-out", str(held), "--out", str(report)]) == 0
    told = json.loads((report / "report.json").read_text())
    assert [e["family"] for e in told["effects"]] == ["depth_scale"]
    assert [i["role"] for i in told["inputs"]] == ["fit", "held_out"]
    assert run(["diagnose", str(fit), "--held-out", str(fit), "--out", str(tmp_path / "again")]) == 3


def test_stamps_of_two_clocks_need_no_mapping(tmp_path: Path) -> None:
    host = np.arange(0.0, 60.0, 0.05)
    device = 1e6 * host * (1.0 + 50e-6)
    path = write_columns(
        tmp_path / "a.csv", seq=np.arange(len(host)), device_time_us=device, host_time_s=host
    )
    made = read_devices([path], [])
    assert made is not None and made.kind == "readings"
    (recording,) = made.fit
    assert recording.quantity == "stamp"
    np.testing.assert_allclose(recording.reading - recording.reference, 50e-6 * host, atol=1e-8)
    drifted = write_columns(tmp_path / "b.csv", camera_stamp=host + 1.7e9, host_stamp=host)
    draft = draft_any([drifted], None, None)
    assert not draft.questions and draft.readings["reading"] == "device + -1700000000.0"
    assert draft.tolerances == {"stamp": 0.05}
    dated = write_columns(tmp_path / "c.csv", camera_stamp=host + 1.7e9, host_stamp=host + 1.7e9 - 40.0)
    (question,) = draft_any([dated], None, None).questions
    assert "is one of them off by so much" in question


def test_clocks_beside_signals_are_none(tmp_path: Path) -> None:
    """Two stamps of a log of something else are no measurement of clocks."""
    host = np.arange(0.0, 60.0, 0.05)
    path = write_columns(
        tmp_path / "a.csv", device_time=host, host_time=host, q1=np.sin(host), q2=np.cos(host)
    )
    assert draft_any([path], None, None).kind == "joints"


def test_a_bag_of_poses_whose_headers_say_all_is_read_at_once(tmp_path: Path) -> None:
    made = read_devices(pose_bag(tmp_path), [])
    assert made is not None and made.kind == "poses" and not made.held_out
    assert made.fit[0].camera_arm is not None
    assert read_devices(opencv(tmp_path), []) is not None


def test_poses_that_may_be_inverse_ask_and_name_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = [str(path) for path in two_files(tmp_path)]
    assert run(["diagnose", *logs, "--out", str(tmp_path / "report")]) == 3
    error = capsys.readouterr().err
    assert "inverse: true" in error and f"samrl bag draft {' '.join(logs)}" in error
    assert not (tmp_path / "report").exists()


def test_logs_of_joints_and_recordings_are_left_to_others(tmp_path: Path) -> None:
    assert read_devices([ros2_bag(tmp_path)], []) is None
    assert read_devices([tmp_path / "none.csv"], []) is None
    joints = write_columns(tmp_path / "a.csv", t=np.arange(60.0), q1=np.arange(60.0))
    assert read_devices([joints], []) is None
    (tmp_path / "bags").mkdir()
    (tmp_path / "bags" / "recordings.json").write_text("{}")
    assert read_devices([tmp_path / "bags"], []) is None


def test_a_motors_volts_are_drafted_with_its_constants_asked(tmp_path: Path) -> None:
    time = np.arange(0.0, 8.0, 0.01)
    turned = 3.0 * np.sin(2.0 * time)
    path = tmp_path / "run.csv"
    counts = turned * 2000 / (2 * np.pi)
    volts = 4.0 * np.cos(2.0 * time)
    rows = [f"{t:.3f};{u:.4f};{c:.0f}" for t, u, c in zip(time, volts, counts, strict=True)]
    path.write_text("bench 4\nZeit [s];Spannung U [V];Encoder\n" + "\n".join(rows).replace(".", ",") + "\n")
    draft = draft_any([path], None, None)
    assert draft.controller["type"] == "voltage_motor"
    assert len(draft.questions) == 2
    assert "counts make a turn" in draft.questions[0] and "resistance [ohm]" in draft.questions[1]
    content = yaml.safe_load(as_yaml(draft))
    del content["questions"]
    content["channels"]["states"]["position"]["unit"] = "counts/2000"
    content["controller"] |= {"torque_constant": [0.05], "resistance": [2.0]}
    mapping = parse_mapping(yaml.safe_dump(content), tmp_path / "m.yaml")
    made = import_recording(mapping.recordings[0], mapping, tmp_path).recording
    assert made.commanded_effort is not None
    np.testing.assert_allclose(made.states.position[:, 0], turned, atol=0.002)
    np.testing.assert_allclose(made.commanded_effort.effort[:, 0], 0.1 * np.cos(2 * time), atol=1e-5)


def test_milliamperes_become_amperes(tmp_path: Path) -> None:
    columns = {"t": MOTION.time, "q_rad": MOTION.position[:, 0], "current_mA": 1e3 * MOTION.effort[:, 0]}
    draft = draft_any([write_csv(tmp_path / "a.csv", columns)], None, None)
    assert draft.channels["commanded_effort"]["effort"]["unit"] == "A"
    assert draft.channels["commanded_effort"]["effort"]["formula"][0].startswith("0.001 * ")
    assert draft.controller["type"] == "current_motor" and "resistance" not in draft.controller


def test_a_pendulum_is_asked_what_drives_it(tmp_path: Path) -> None:
    time = np.arange(0.0, 8.0, 0.01)
    path = write_columns(tmp_path / "a.csv", time=time, angle_deg=60.0 * np.cos(3.0 * time))
    urdf = urdf_of(JOINTS[:1])
    (question,) = draft_any([path], urdf, "arm.urdf").questions
    assert "--effort passive" in question
    draft = draft_any([path], urdf, "arm.urdf", Effort.passive)
    assert not draft.questions and draft.joints == [JOINTS[0]]
    assert draft.channels["commanded_effort"]["effort"] == [0.0]


def test_universal_robots_recorder_is_read_as_it_is(tmp_path: Path) -> None:
    """Blanks between columns, numbered joints from 0, radians by its documentation."""
    names = tuple(str(k) for k in range(3))
    columns = {"timestamp": 4500.1 + MOTION.time}
    columns |= by_joint("target_q_{}", MOTION.target, names) | by_joint("actual_q_{}", MOTION.position, names)
    columns |= by_joint("actual_qd_{}", MOTION.velocity, names)
    path = tmp_path / "robot_data.csv"
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, header=" ".join(columns), comments="", fmt="%.6f")
    draft = draft_any([path], None, None)
    assert not draft.questions and draft.sources["states"]["csv"] == {"delimiter": " "}
    assert draft.channels["states"]["velocity"]["unit"] == "rad/s"
    assert draft.channels["command"]["position"]["formula"][0] == "target_q_1"


def test_a_folder_of_runs_is_diagnosed_as_its_files(tmp_path: Path) -> None:
    """The last run by name is held out, as of several files that are named."""
    for run_name, late in (("b", 3), ("a", 2), ("c", 4)):
        names = tuple(str(k) for k in range(3))
        columns = {"t_s": MOTION.time} | by_joint("q_rad_{}", np.roll(MOTION.position, late, axis=0), names)
        write_csv(tmp_path / f"{run_name}.csv", columns | by_joint("q_cmd_rad_{}", MOTION.target, names))
    assert runs_in(tmp_path) == [tmp_path / f"{name}.csv" for name in "abc"]
    fit, held_out, _ = load(DiagnoseOptions(bags=(tmp_path,), effort=Effort.none))
    assert [recording.name for recording in (*fit, *held_out)] == ["a", "b", "c"] and len(held_out) == 1
    assert runs_in(tmp_path / "a.csv") == [tmp_path / "a.csv"]
