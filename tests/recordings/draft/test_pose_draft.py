"""Drafted mappings of pose logs of different make: who moves and what stands where, or a question."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording, PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_ros.cli.main import run
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.poses.pose_draft import draft_poses
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables
from samrl_ros.log_import.draft.writing import as_yaml
from tests.diagnosis.poses.pose_worlds import PoseWorld, record


def made(at_rest: bool = False) -> tuple[PoseTrack, PoseTrack]:
    """The target in a camera that rides on the arm, and the flange in its base."""
    recording = record(PoseWorld(at_rest=at_rest, seconds=8.0))
    assert recording.camera_arm is not None and recording.camera_arm.flange is not None
    return recording.seen, recording.camera_arm.flange


def still_camera() -> tuple[PoseTrack, PoseTrack]:
    """The same with the arm carrying the target: what was seen from the flange, seen from the table."""
    seen, flange = made()
    poses = rigid.inverse(rigid.transforms(flange.position, flange.quat_xyzw))
    turned = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return seen, PoseTrack(flange.time, poses[:, :3, 3], turned)


def write_csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns),
               comments="", fmt="%.9f")  # fmt: skip
    return path


def named(pattern: str, letters: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {pattern.format(letter): values[:, k] for k, letter in enumerate(letters)}


def one_csv(folder: Path) -> list[Path]:
    seen, flange = made()
    columns = {"timestamp": seen.time}
    columns |= named("tag_{}", "xyz", seen.position) | named("tag_q{}", "xyzw", seen.quat_xyzw)
    columns |= named("ee_{}", "xyz", flange.position) | named("ee_q{}", "xyzw", flange.quat_xyzw)
    return [write_csv(folder / "run.csv", columns)]


def two_files(folder: Path) -> list[Path]:
    seen, flange = made()
    out = []
    for name, track in (("run_robot", flange), ("run_tag", seen)):
        columns = {"time_ms": 1e3 * track.time} | named("{}", "xyz", 1e3 * track.position)
        columns |= named("q{}", "wxyz", track.quat_xyzw[:, [3, 0, 1, 2]])
        out.append(write_csv(folder / f"{name}.csv", columns))
    return out


def opencv(folder: Path) -> list[Path]:
    seen, flange = made(at_rest=True)
    arrays = {}
    for name, track in (("gripper2base", flange), ("target2cam", seen)):
        arrays[f"R_{name}"] = Rotation.from_quat(track.quat_xyzw).as_matrix()
        arrays[f"t_{name}"] = track.position
    np.savez(folder / "calib.npz", **arrays)
    return [folder / "calib.npz"]


def arrays_to_hand(folder: Path) -> list[Path]:
    seen, flange = still_camera()
    first = [3, 0, 1, 2]
    np.savez(
        folder / "log.npz",
        t=seen.time,
        marker_pos=seen.position,
        marker_quat=seen.quat_xyzw[:, first],
        flange_pos=flange.position,
        flange_quat=flange.quat_xyzw[:, first],
    )
    return [folder / "log.npz"]


def vectors(folder: Path) -> list[Path]:
    seen, flange = made()
    columns = {"stamp_ns": 1e9 * seen.time}
    columns |= named("board_tvec_{}", "xyz", seen.position)
    columns |= named("board_rvec_{}", "xyz", Rotation.from_quat(seen.quat_xyzw).as_rotvec())
    columns |= named("tcp_{}_mm", "xyz", 1e3 * flange.position)
    turned = np.degrees(Rotation.from_quat(flange.quat_xyzw).as_euler("xyz"))
    columns |= {f"tcp_{n}_deg": turned[:, k] for k, n in enumerate(("roll", "pitch", "yaw"))}
    return [write_csv(folder / "board.csv", columns)]


def ros2_bag(folder: Path) -> list[Path]:
    """Stamped poses whose headers name the parent."""
    types = get_typestore(Stores.ROS2_JAZZY)
    make, kind = types.types, "geometry_msgs/msg/PoseStamped"
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, frame, track in zip(
            ("/tag_pose", "/ee_pose"), ("camera_color_optical_frame", "panda_link0"), made(), strict=True
        ):
            connection = writer.add_connection(topic, kind, typestore=types)
            for time, position, q in zip(track.time, track.position, track.quat_xyzw, strict=True):
                ns = round(1e9 * (1000.0 + time))
                stamp = make["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
                point, turn = make["geometry_msgs/msg/Point"], make["geometry_msgs/msg/Quaternion"]
                pose = make["geometry_msgs/msg/Pose"](point(*position), turn(*q))
                message = make[kind](make["std_msgs/msg/Header"](stamp, frame), pose)
                writer.write(connection, ns, types.serialize_cdr(message, kind))
    return [folder / "bag"]


def opencv_lists(folder: Path) -> list[Path]:
    """What `calibrateCamera` gives, in mm, beside matrices of the robot."""
    seen, flange = made(at_rest=True)
    lists = {
        "R_gripper2base": Rotation.from_quat(flange.quat_xyzw).as_matrix(),
        "t_gripper2base": 1e3 * flange.position,
        "rvecs_target2cam": Rotation.from_quat(seen.quat_xyzw).as_rotvec(),
        "tvecs_target2cam": 1e3 * seen.position,
    }
    path = folder / "calib.json"
    path.write_text(json.dumps({name: values.tolist() for name, values in lists.items()}))
    return [path]


LOGS: dict[str, tuple[Callable[[Path], list[Path]], Callable[[], tuple[PoseTrack, PoseTrack]], str, int]] = {
    "one CSV": (one_csv, made, "camera_arm", 1),
    "two files": (two_files, made, "camera_arm", 1),
    "OpenCV": (opencv, lambda: made(at_rest=True), "camera_arm", 0),
    "OpenCV's lists": (opencv_lists, lambda: made(at_rest=True), "camera_arm", 0),
    "arrays": (arrays_to_hand, still_camera, "tool_arm", 1),
    "ROS 2 bag": (ros2_bag, made, "camera_arm", 0),
    "vectors": (vectors, made, "camera_arm", 1),
}


def drafted(paths: list[Path]) -> Draft | None:
    return draft_poses([track for table in read_logged_tables(paths) for track in table.tracks()])


def imported(draft: Draft, folder: Path) -> PoseRecording:
    """By the draft, with its questions answered as they stand."""
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    (folder / "m.yaml").write_text(yaml.safe_dump(content))
    return import_any(folder / "m.yaml", folder, None).made[0].recording


@pytest.mark.parametrize(
    "log", [pytest.param(n, marks=pytest.mark.thorough) if n in ("arrays", "vectors") else n for n in LOGS]
)
def test_each_log_is_read_as_it_was_made(log: str, tmp_path: Path) -> None:
    write, true, arm, asked = LOGS[log]
    draft = drafted(write(tmp_path))
    assert draft is not None
    assert len(draft.questions) == asked, draft.questions
    got = imported(draft, tmp_path)
    seen, flange = true()
    carried = getattr(got, arm)
    assert carried is not None and carried.flange is not None
    for a, b in ((got.seen, seen), (carried.flange, flange)):
        assert np.allclose(a.position, b.position, atol=1e-6)
        turned = Rotation.from_quat(a.quat_xyzw).inv() * Rotation.from_quat(b.quat_xyzw)
        assert float(turned.magnitude().max()) < 1e-6
    assert "closes to" in as_yaml(draft) and "your calibration" in as_yaml(draft)


def test_poses_of_two_things_are_asked_about(tmp_path: Path) -> None:
    """Two tracks that have nothing to do with each other close no chain."""
    seen, flange = made()
    order = np.random.default_rng(0).permutation(len(seen.time))
    columns = {"timestamp": seen.time}
    columns |= named("tag_{}", "xyz", seen.position[order]) | named("tag_q{}", "xyzw", seen.quat_xyzw[order])
    columns |= named("ee_{}", "xyz", flange.position) | named("ee_q{}", "xyzw", flange.quat_xyzw)
    draft = drafted([write_csv(tmp_path / "a.csv", columns)])
    assert draft is not None and any("no description closes" in q for q in draft.questions)


def test_poses_that_stand_still_prove_nothing(tmp_path: Path) -> None:
    """Any chain closes, and steps of 1 are seconds between poses at rest as well as milliseconds."""
    still = np.tile([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0], (20, 1))
    columns = {"t": np.arange(20.0)}
    for name in ("tag", "ee"):
        columns |= named(f"{name}_{{}}", "xyz", still) | named(f"{name}_q{{}}", "xyzw", still[:, 3:])
    draft = drafted([write_csv(tmp_path / "a.csv", columns)])
    assert draft is not None
    assert any("is 't' in ms, and not in s?" in q for q in draft.questions), draft.questions
    assert any("is it so, and not that" in q for q in draft.questions), draft.questions


@pytest.mark.parametrize("kind", ["rotation_vector", "rpy"])
def test_three_letters_of_a_rotation_are_what_closes_the_chain(kind: str, tmp_path: Path) -> None:
    """rx, ry, rz are a rotation vector to some controllers and Euler angles to others."""
    seen, flange = made()
    turned = Rotation.from_quat(flange.quat_xyzw)
    three = turned.as_rotvec() if kind == "rotation_vector" else np.degrees(turned.as_euler("xyz"))
    columns = {"t": seen.time} | named("tag_{}", "xyz", seen.position)
    columns |= named("tag_q{}", "xyzw", seen.quat_xyzw)
    columns |= named("tcp_{}", "xyz", flange.position) | named("tcp_r{}", "xyz", three)
    draft = drafted([write_csv(tmp_path / "a.csv", columns)])
    assert draft is not None and kind in draft.poses["camera_arm"]["flange"]
    got = imported(draft, tmp_path).camera_arm
    assert got is not None and got.flange is not None
    apart = Rotation.from_quat(got.flange.quat_xyzw).inv() * turned
    assert float(apart.magnitude().max()) < 1e-6


def test_universal_robots_recorder_gives_the_flange(tmp_path: Path) -> None:
    """actual_TCP_pose_0 to 5 beside joints: metres and a rotation vector, by its documentation."""
    seen, flange = made()
    pose = np.column_stack([flange.position, Rotation.from_quat(flange.quat_xyzw).as_rotvec()])
    columns = {"timestamp": flange.time} | {f"actual_q_{k}": 0.1 * pose[:, k] for k in range(6)}
    columns |= {f"actual_TCP_pose_{k}": pose[:, k] for k in range(6)}
    robot = tmp_path / "robot.csv"
    table = np.column_stack(list(columns.values()))
    np.savetxt(robot, table, header=" ".join(columns), comments="", fmt="%.9f")
    tag = {"t": seen.time} | named("tag_{}", "xyz", seen.position) | named("tag_q{}", "xyzw", seen.quat_xyzw)
    draft = drafted([robot, write_csv(tmp_path / "tag.csv", tag)])
    assert draft is not None and len(draft.questions) == 1
    got = imported(draft, tmp_path).camera_arm
    assert got is not None and got.flange is not None
    assert np.allclose(got.flange.position, flange.position, atol=1e-6)


@pytest.mark.parametrize("pattern", ["run{}_{}", "{1}-{0}", "both"])
def test_files_of_several_runs_are_recordings_of_one_chain(pattern: str, tmp_path: Path) -> None:
    """The last run is held out, whether its number stands before or behind what the file holds."""
    seen, flange = made()
    half = len(seen) // 2
    for number, rows in ((1, slice(0, half)), (2, slice(half, None))):
        tables = {}
        for name, track in (("robot", flange), ("tag", seen)):
            columns = {"t": track.time[rows]} | named(f"{name}_{{}}", "xyz", track.position[rows])
            tables[name] = columns | named(f"{name}_q{{}}", "xyzw", track.quat_xyzw[rows])
        if pattern == "both":
            write_csv(tmp_path / f"{number}.csv", tables["robot"] | tables["tag"])
            continue
        for name, columns in tables.items():
            write_csv(tmp_path / f"{pattern.format(number, name)}.csv", columns)
    draft = drafted([tmp_path])
    assert draft is not None and len(draft.questions) == 1  # which way round
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(content))
    made_of = import_any(tmp_path / "m.yaml", tmp_path, None).made
    assert [each.role for each in made_of] == ["fit", "held_out"]
    for each, rows in zip(made_of, (slice(0, half), slice(half, None)), strict=True):
        assert np.allclose(each.recording.seen.position, seen.position[rows], atol=1e-6)


def test_stamps_in_two_columns_and_runs_of_a_kuka_with_a_board(tmp_path: Path) -> None:
    """Nanoseconds beside whole seconds are the rest of a stamp; KUKA's letters need no other name."""
    seen, flange = still_camera()
    half = len(seen) // 2
    for number, rows in ((1, slice(0, half)), (2, slice(half, None))):
        time, turned = seen.time[rows] + 1000.0, Rotation.from_quat(flange.quat_xyzw[rows])
        angles = turned.as_euler("ZYX", degrees=True)
        robot = {"t": time} | named("{}", "XYZ", 1e3 * flange.position[rows]) | named("{}", "ABC", angles)
        write_csv(tmp_path / f"meas{number}_a.csv", robot)
        board = {"sec": np.floor(time), "nanosec": np.round(1e9 * (time % 1.0))}
        vectors = Rotation.from_quat(seen.quat_xyzw[rows]).as_rotvec()
        board |= named("rvec_{}", "xyz", vectors) | named("tvec_{}", "xyz", seen.position[rows])
        write_csv(tmp_path / f"meas{number}_b.csv", board)
    draft = drafted([tmp_path])
    assert draft is not None and [each["name"] for each in draft.recordings] == ["meas1", "meas2"]
    got = imported(draft, tmp_path)
    assert got.tool_arm is not None and np.allclose(got.seen.position, seen.position[:half], atol=1e-6)
    assert np.allclose(np.diff(got.seen.time), np.diff(seen.time[:half]), atol=1e-6)


def test_a_log_of_joints_is_none_of_poses(tmp_path: Path) -> None:
    time = np.arange(60.0)
    assert drafted([write_csv(tmp_path / "a.csv", {"t": time, "q1": time, "q2": time})]) is None


def test_the_command_writes_a_mapping_that_waits_for_the_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (log,) = one_csv(tmp_path)
    out = tmp_path / "m.yaml"
    assert run(["bag", "draft", str(log), "--out", str(out)]) == 0
    assert "1 ask" in capsys.readouterr().out
    with pytest.raises(InputError, match="questions"):
        import_any(out, tmp_path, None)
    text = out.read_text()
    content = yaml.safe_load(text)
    del content["questions"]
    out.write_text(yaml.safe_dump(content))
    assert run(["bag", "import", str(out), "--out", str(tmp_path / "bags")]) == 0


def test_hand_eye_files_of_eth_are_two_devices_and_name_their_frames(tmp_path: Path) -> None:
    """`poses_B_H.csv` and `poses_W_E.csv`, no header, dated stamps, two rates: no body, though it falls."""
    time = 1.5e9 + np.arange(0.0, 8.0, 0.02)
    t = time - time[0]
    place = np.stack([0.3 * np.sin(1.7 * t), 0.3 * np.cos(1.1 * t), 0.5 + 0.2 * np.sin(0.9 * t)], axis=1)
    turn = Rotation.from_rotvec(np.stack([0.7 * np.sin(1.3 * t), 0.6 * np.sin(0.8 * t), np.sin(t)], axis=1))
    eye = turn * Rotation.from_euler("z", 1.5)
    world = Rotation.from_euler("xyz", [0.1, -0.2, 0.4])
    seen = world.inv().apply(place + turn.apply([0.05, 0.01, 0.06]) - [0.5, 0.1, 0.0])
    for name, step, p, q in (("poses_B_H", 1, place, turn), ("poses_W_E", 3, seen, world.inv() * eye)):
        rows = np.column_stack([time, p, q.as_quat()])[::step]
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", fmt="%.9f")
    draft = draft_any([tmp_path], None, None)
    assert draft.kind == "poses" and not draft.questions
    assert draft.poses["target_in_camera"]["inverse"] is True
    assert draft.sources["flange"]["file"] == "poses_B_H.csv" and "camera_arm" in draft.poses
