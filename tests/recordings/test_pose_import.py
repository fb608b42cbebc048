"""Logs of poses by a mapping alone, to files and to a report by the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_ros.cli.main import run
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.pose_importer import poses_of
from samrl_ros.recordings.pose_file import read_pose_file, write_pose_file
from tests.diagnosis.poses.pose_worlds import CAMERA, SMALL, TARGET, PoseWorld, record


def write_log(path: Path, track: PoseTrack) -> None:
    """Milliseconds, millimetres and quaternions with w first, as many a tracker writes."""
    table = np.column_stack([1e3 * track.time, 1e3 * track.position, track.quat_xyzw[:, [3, 0, 1, 2]]])
    np.savetxt(path, table, delimiter=",", header="ms,x,y,z,qw,qx,qy,qz", comments="", fmt="%.9f")


def mapping() -> dict:
    columns = {name: name for name in ("x", "y", "z", "qw", "qx", "qy", "qz")}
    pose = {
        "position": ["x", "y", "z"],
        "unit": "mm",
        "quaternion": ["qw", "qx", "qy", "qz"],
        "order": "wxyz",
    }
    time = {"column": "ms", "unit": "ms"}
    return {
        "sources": {
            "robot": {"file": "{name}_robot.csv", "time": time, "columns": columns},
            "tag": {"file": "{name}_tag.csv", "time": time, "columns": columns},
        },
        "poses": {
            "target_in_camera": {"source": "tag", **pose},
            "camera_arm": {"flange": {"source": "robot", **pose}},
            "camera_in_flange": {"matrix": CAMERA.tolist()},
            "target_in_base": {
                "position": TARGET[:3, 3].tolist(),
                "rotation_vector": Rotation.from_matrix(TARGET[:3, :3]).as_rotvec().tolist(),
            },
        },
        "recordings": [{"name": "a"}, {"name": "b", "role": "held_out"}],
    }


def test_open_questions_of_a_draft_are_told(tmp_path: Path) -> None:
    file = tmp_path / "mapping.yaml"
    file.write_text(yaml.safe_dump({**mapping(), "questions": ["poses: which is the hand?"]}))
    with pytest.raises(InputError, match=r"questions of its draft are open.*\n  poses: which is the hand"):
        poses_of(file.read_text(), file, tmp_path)


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    for name, seed in (("a", 1), ("b", 2)):
        # The same errors in both recordings: only the noise differs.
        recording = record(PoseWorld(camera_error=SMALL), seed=1)
        rng = np.random.default_rng(seed)
        seen = recording.seen
        moved = PoseTrack(
            seen.time, seen.position + 1e-4 * rng.standard_normal(seen.position.shape), seen.quat_xyzw
        )
        assert recording.camera_arm is not None and recording.camera_arm.flange is not None
        write_log(tmp_path / f"{name}_robot.csv", recording.camera_arm.flange)
        write_log(tmp_path / f"{name}_tag.csv", moved)
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(mapping()))
    return tmp_path


def imported(folder: Path, content: dict) -> PoseRecording:
    (folder / "mapping.yaml").write_text(yaml.safe_dump(content))
    return import_any(folder / "mapping.yaml", folder, None).made[0].recording


def test_a_mapping_alone_gives_a_report(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert import_any(logs / "mapping.yaml", logs, None).kind == "poses"
    assert run(["bag", "import", str(logs / "mapping.yaml"), "--out", str(logs / "bags")]) == 0
    assert run(["diagnose", str(logs / "bags"), "--out", str(logs / "report")]) == 0
    report = json.loads((logs / "report" / "report.json").read_text())
    assert report["verdict"] == "effect"
    assert [f"{e['family']}@{e['place']}" for e in report["effects"]] == ["hand_eye@sensor:camera"]
    assert report["gap"]["held_out"]["shrink"] > 0.4 and report["where"][0]["place"] == "sensor:camera"
    assert [i["role"] for i in report["inputs"]] == ["fit", "held_out"]
    assert "hand_eye" in capsys.readouterr().out
    page = (logs / "report" / "report.html").read_text()
    assert "Hand-eye calibration" in page and (logs / "report" / "summary.png").stat().st_size > 10_000
    # Reports are not replaced, and held-out poses are none that were fitted.
    assert run(["diagnose", str(logs / "bags"), "--out", str(logs / "report")]) == 3
    both = [str(logs / "bags" / "a.poses.npz"), "--held-out", str(logs / "bags" / "a.poses.npz")]
    assert run(["diagnose", *both, "--out", str(logs / "again")]) == 3


def test_files_hold_what_was_imported(logs: Path) -> None:
    (made, _) = import_any(logs / "mapping.yaml", logs, logs / "bags").made
    read = read_pose_file(logs / "bags" / "a.poses.npz")
    for a, b in ((made.recording.seen, read.seen),):
        assert np.array_equal(a.position, b.position) and np.array_equal(a.quat_xyzw, b.quat_xyzw)
    assert read.camera_in_flange is not None and np.allclose(read.camera_in_flange.matrix(), CAMERA)
    assert read.base_in_base is not None and np.allclose(read.base_in_base.matrix(), TARGET, atol=1e-9)
    assert read.timed and read.tolerances == made.recording.tolerances
    with pytest.raises(InputError, match="exists already"):
        import_any(logs / "mapping.yaml", logs, logs / "bags")
    content = (logs / "bags" / "a.poses.npz").read_bytes()
    (logs / "cut.poses.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError):
        read_pose_file(logs / "cut.poses.npz")


def test_a_file_without_a_known_arm_is_refused(logs: Path) -> None:
    """Of a misspelt role nothing was read, and the diagnosis ended in a traceback."""
    (made, _) = import_any(logs / "mapping.yaml", logs, logs / "bags").made
    for arm, said in ((None, "its arms are none"), (ArmPoses("camera_arm"), "its camera_arm has no poses")):
        write_pose_file(replace(made.recording, camera_arm=arm, tool_arm=None), logs / "none.poses.npz")
        with pytest.raises(InputError, match=said):
            read_pose_file(logs / "none.poses.npz")


def test_every_kind_of_rotation_is_the_same_pose(logs: Path) -> None:
    content = mapping()
    expected = imported(logs, content)
    turned = Rotation.from_quat(expected.seen.quat_xyzw)
    stamps = expected.seen.time
    for key, numbers in (
        ("rotation_vector", np.rad2deg(turned.as_rotvec())),
        ("rpy", np.rad2deg(turned.as_euler("xyz"))),
    ):
        table = np.column_stack([stamps, expected.seen.position, numbers])
        np.savetxt(logs / "other.csv", table, delimiter=",", header="t,x,y,z,a,b,c", comments="", fmt="%.12f")
        names = {name: name for name in "xyzabc"}
        content["sources"]["tag"] = {"file": "other.csv", "time": {"column": "t"}, "columns": names}
        content["poses"]["target_in_camera"] = {
            "source": "tag", "position": ["x", "y", "z"], key: ["a", "b", "c"], "angle_unit": "deg",
        }  # fmt: skip
        found = imported(logs, content)
        assert np.allclose(found.seen.position, expected.seen.position, atol=1e-9)
        between = Rotation.from_quat(found.seen.quat_xyzw).inv() * turned
        assert float(np.max(between.magnitude())) < 1e-8
    content["poses"]["target_in_camera"]["inverse"] = True
    inverse = imported(logs, content)
    back = Rotation.from_quat(inverse.seen.quat_xyzw).apply(expected.seen.position) + inverse.seen.position
    assert np.max(np.abs(back)) < 1e-9


@pytest.mark.parametrize(
    "key, value, message",
    [
        ("camera_in_base", {"position": [0, 0, 0], "rpy": [0, 0, 0]}, "no part of this chain"),
        ("camera_arm", None, "needs camera_arm or tool_arm"),
        ("camera_in_flange", {"position": [0, 0], "rpy": [0, 0, 0]}, "camera_in_flange needs position"),
        ("target_in_camera", {"source": "tag", "position": ["x", "y", "z"]}, "one of quaternion"),
        ("target_in_camera", {"source": "nobody", "matrix": "x"}, "sources are"),
        (
            "target_in_camera",
            {"source": "tag", "position": ["x", "y", "z"], "quaternion": ["x", "y", "z", "qw"]},
            "must be 1",
        ),
    ],
)
def test_bad_mappings_name_the_key(logs: Path, key: str, value: object, message: str) -> None:
    content = mapping()
    content["poses"][key] = value
    with pytest.raises(InputError, match=message) as caught:
        imported(logs, content)
    assert "recordings[0]" in str(caught.value)


def test_stacks_of_matrices_without_times_are_pairs(tmp_path: Path) -> None:
    """OpenCV's arrays in an npz, MATLAB's with samples last: fifteen pairs at rest, all fitted."""
    recording = record(PoseWorld(camera_error=SMALL, at_rest=True))
    assert recording.camera_arm is not None and recording.camera_arm.flange is not None
    stacks = [
        rigid.transforms(track.position, track.quat_xyzw)[:15]
        for track in (recording.camera_arm.flange, recording.seen)
    ]
    numpy_arrays = {
        f"{key}_{name}": values
        for name, poses in zip(("robot", "board"), stacks, strict=True)
        for key, values in (("R", poses[:, :3, :3]), ("t", poses[:, :3, 3:]))
    }
    np.savez(tmp_path / "numpy.npz", **numpy_arrays)
    savemat(tmp_path / "matlab.mat", {k: np.moveaxis(p, 0, 2) for k, p in zip("AB", stacks, strict=True)})
    stated = {key: mapping()["poses"][key] for key in ("camera_in_flange", "target_in_base")}
    both = (
        (
            "numpy.npz", numpy_arrays,
            [{"position": f"t_{n}", "rotation_matrix": f"R_{n}"} for n in ("board", "robot")],
        ),
        ("matlab.mat", ("A", "B"), [{"matrix": "B"}, {"matrix": "A"}]),
    )  # fmt: skip
    for file, columns, (board, robot) in both:
        content = {
            "sources": {"log": {"file": file, "columns": {name: name for name in columns}}},
            "poses": {"at_rest": True, "target_in_camera": board, "camera_arm": {"flange": robot}, **stated},
            "recordings": [{"name": "pairs"}],
        }
        found = imported(tmp_path, content)
        assert len(found.seen) == 15 and not found.timed
        assert np.allclose(rigid.transforms(found.seen.position, found.seen.quat_xyzw), stacks[1], atol=1e-6)
    assert run(["bag", "import", str(tmp_path / "mapping.yaml"), "--out", str(tmp_path / "bags")]) == 0
    assert run(["diagnose", str(tmp_path / "bags"), "--out", str(tmp_path / "report")]) == 0
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    assert [e["family"] for e in report["effects"]] == ["hand_eye"] and report["verdict"] == "effect"


def test_pairs_at_rest_far_apart_in_time_are_no_pairs(logs: Path) -> None:
    content = mapping()
    content["poses"]["at_rest"] = True
    content["sources"]["robot"]["time"] = {"column": "ms", "unit": "ms", "offset_s": 5000.0}
    with pytest.raises(InputError, match="leave `time` out"):
        imported(logs, content)


def test_clocks_of_different_days_are_refused(logs: Path) -> None:
    content = mapping()
    content["sources"]["robot"]["time"] = {"column": "ms", "unit": "ms", "offset_s": 5000.0}
    with pytest.raises(InputError, match="no overlap"):
        imported(logs, content)


@pytest.mark.parametrize("key", ["files", "parts"])
def test_a_source_that_is_not_there_is_named(logs: Path, key: str) -> None:
    (logs / "bad.yaml").write_text(yaml.safe_dump({**mapping(), key: {"nobody": "x.csv"}}))
    with pytest.raises(InputError, match=rf"recordings\[0\]\.{key}: no source \['nobody'\]; there are"):
        import_any(logs / "bad.yaml", logs, None)
