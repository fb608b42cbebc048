"""Drafted mappings of twelve logs of different make: each field right or asked, never wrong in silence."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.io import savemat

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.draft import draft_mapping
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.foreign import is_foreign, read_foreign
from samrl_ros.log_import.formats.control_msgs import RELEASES
from samrl_ros.log_import.importer import import_recording
from samrl_ros.log_import.mapping import parse_mapping, read_mapping
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table

RATE = 100.0
COUNT = 600
JOINTS = ("shoulder", "elbow", "wrist")
STATE = "control_msgs/msg/JointTrajectoryControllerState"


@dataclass(frozen=True, eq=False)
class Motion:
    """What really happened: SI units, joints in the order of JOINTS."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    target: np.ndarray
    effort: np.ndarray


def _motion() -> Motion:
    time = np.arange(COUNT) / RATE
    phase = np.outer(time, [2.1, 3.3, 4.7]) + [0.0, 0.4, 1.1]
    size = np.array([0.9, 0.6, 0.5])
    lag = np.outer(np.ones(COUNT), [0.02, 0.01, 0.015])
    return Motion(
        time,
        size * np.sin(phase),
        size * np.array([2.1, 3.3, 4.7]) * np.cos(phase),
        size * np.sin(phase) + lag,
        4.0 * np.cos(phase) + np.array([1.0, -2.0, 0.3]),
    )


MOTION = _motion()


def _urdf(names: tuple[str, ...]) -> str:
    links = "".join(f'<link name="l{k}"/>' for k in range(len(names) + 1))
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="9"/></joint>'
        for k, name in enumerate(names)
    )
    return f'<robot name="r">{links}{joints}</robot>'


def _csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    return path


def _by_joint(pattern: str, values: np.ndarray, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    return {pattern.format(name): values[:, k] for k, name in enumerate(names)}


NUMBERS = ("1", "2", "3")


def snake_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"time_s": m.time, **_by_joint("{}_position_rad", m.position, JOINTS)}
    columns |= _by_joint("{}_velocity", m.velocity, JOINTS) | _by_joint(
        "{}_target_position", m.target, JOINTS
    )
    return _csv(folder / "run.csv", columns | _by_joint("{}_torque_nm", m.effort, JOINTS))


def degrees_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"timestamp_ms": 1e3 * m.time, **_by_joint("actual_q_deg{}", np.degrees(m.position), NUMBERS)}
    columns |= _by_joint("actual_qd{}", m.velocity, NUMBERS)
    return _csv(folder / "ur.csv", columns | _by_joint("target_q_deg{}", np.degrees(m.target), NUMBERS))


def short_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"t": m.time, **_by_joint("q{}", m.position, NUMBERS), **_by_joint("dq{}", m.velocity, NUMBERS)}
    return _csv(folder / "short.csv", columns | _by_joint("tau{}", m.effort, NUMBERS))


def camel_csv(folder: Path) -> Path:
    m = MOTION
    columns = {"TimeStamp": 1e6 * m.time, **_by_joint("ActualPosition{}", m.position, NUMBERS)}
    return _csv(folder / "plc.csv", columns | _by_joint("CommandPosition{}", m.target, NUMBERS))


def counts_csv(folder: Path) -> Path:
    counts = np.round(2048 + MOTION.position * 4096 / (2 * np.pi))
    goals = np.round(2048 + MOTION.target * 4096 / (2 * np.pi))
    columns = {"t": MOTION.time, **_by_joint("present_position_{}", counts, NUMBERS)}
    return _csv(folder / "servo.csv", columns | _by_joint("goal_position_{}", goals, NUMBERS))


def arrays_npz(folder: Path) -> Path:
    m = MOTION
    np.savez(folder / "a.npz", t=m.time, qpos=m.position, qvel=m.velocity, tau=m.effort, target_q=m.target)
    return folder / "a.npz"


def matlab(folder: Path) -> Path:
    m = MOTION
    savemat(folder / "a.mat", {"log": {"time": m.time, "q_meas": m.position, "q_ref": m.target}})
    return folder / "a.mat"


def aloha_hdf5(folder: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.hdf5", "w") as file:
        file["observations/qpos"], file["observations/qvel"] = MOTION.position, MOTION.velocity
        file["action"] = MOTION.target
    return folder / "a.hdf5"


def lerobot(folder: Path) -> Path:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as parquet

    path = folder / "set"
    (path / "meta").mkdir(parents=True)
    (path / "data/chunk-000").mkdir(parents=True)
    names = [f"{joint}.pos" for joint in JOINTS]
    features = {key: {"names": names} for key in ("observation.state", "action")}
    (path / "meta/info.json").write_text(json.dumps({"total_episodes": 1, "features": features}))
    columns = {
        "observation.state": np.degrees(MOTION.position).tolist(),
        "action": np.degrees(MOTION.target).tolist(),
        "timestamp": MOTION.time.tolist(),
        "frame_index": list(range(COUNT)),
        "episode_index": [0] * COUNT,
    }
    parquet.write_table(pa.table(columns), path / "data/chunk-000/file-000.parquet")
    return path


def samples_json(folder: Path) -> Path:
    samples = [
        {"time": t, "state": {"position": q, "velocity": v}, "command": {"position": d}}
        for t, q, v, d in zip(
            MOTION.time.tolist(),
            MOTION.position.tolist(),
            MOTION.velocity.tolist(),
            MOTION.target.tolist(),
            strict=True,
        )
    ]
    (folder / "a.json").write_text(json.dumps(samples))
    return folder / "a.json"


def _header(store: Any, k: int, ros1: bool) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=100 + k // 100, nanosec=(k % 100) * 10_000_000)
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **({"seq": k} if ros1 else {}))


def _bag(path: Path, ros1: bool) -> Path:
    """Joint states in the URDF's wrong order beside a gripper, a controller's state, a description."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    if not ros1:
        for name, text in RELEASES[2].items():
            store.register(get_types_from_msg(text, name))
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
    encode: Callable[[Any, str], Any] = store.serialize_ros1 if ros1 else store.serialize_cdr
    order = [2, 0, 1]
    with writer:
        states = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        about = writer.add_connection("/robot_description", "std_msgs/msg/String", typestore=store)
        text = store.types["std_msgs/msg/String"](data=_urdf(JOINTS))
        writer.write(about, 1, encode(text, "std_msgs/msg/String"))
        control = (
            None
            if ros1
            else writer.add_connection("/arm_controller/controller_state", STATE, typestore=store)
        )
        for k in range(COUNT):
            message = store.types["sensor_msgs/msg/JointState"](
                header=_header(store, k, ros1),
                name=[*(JOINTS[i] for i in order), "finger"],
                position=np.append(MOTION.position[k, order], 0.04),
                velocity=np.append(MOTION.velocity[k, order], 0.0),
                effort=np.append(MOTION.effort[k, order], 0.0),
            )
            writer.write(states, 10**9 + k, encode(message, "sensor_msgs/msg/JointState"))
            if control is not None:
                writer.write(control, 10**9 + k, store.serialize_cdr(_state(store, k), STATE))
    return path


def _state(store: Any, k: int) -> Any:
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    free = store.types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]
    none = store.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    empty = np.array([])
    values = {"reference": MOTION.target[k], "feedback": MOTION.position[k]}
    points = {
        name: point(values.get(name, np.zeros(3)), empty, empty, empty, none)
        for name in ("reference", "feedback", "error", "output")
    }
    frees = {f"multi_dof_{name}": free([], [], [], none) for name in points}
    return store.types[STATE](
        header=_header(store, k, False), joint_names=[*JOINTS], multi_dof_joint_names=[], **points, **frees
    )


def ros2_bag(folder: Path) -> Path:
    return _bag(folder / "bag", ros1=False)


def ros1_bag(folder: Path) -> Path:
    return _bag(folder / "a.bag", ros1=True)


# Log, whether the robot's description is given, and how many questions it leaves (measured, not wished).
LOGS: list[tuple[Callable[[Path], Path], bool]] = [
    (snake_csv, True),
    (degrees_csv, True),
    (short_csv, True),
    (camel_csv, False),
    (counts_csv, False),
    (arrays_npz, True),
    (matlab, False),
    (aloha_hdf5, False),
    (lerobot, False),
    (samples_json, False),
    (ros2_bag, False),
    (ros1_bag, False),
]


def _made(path: Path, described: bool, effort: Effort = Effort.ask) -> Draft:
    return draft_mapping(
        [path], _urdf(JOINTS) if described else None, "arm.urdf" if described else None, effort
    )


def _wrong_in_silence(draft: Draft, path: Path, folder: Path) -> list[str]:
    """Fields whose values are not those of the motion although nothing was asked about them."""
    (folder / "arm.urdf").write_text(_urdf(JOINTS))
    text = as_yaml(draft)
    content = (
        text
        if not draft.questions
        else text.replace("questions:", "about:\n  was:", 1).replace("\nabout: D", "\n# D", 1)
    )
    data = (
        path
        if path.is_dir() and not any(s["file"] == path.name for s in draft.sources.values())
        else path.parent
    )
    mapping = parse_mapping(content, folder / "m.yaml")
    recording = import_recording(mapping.recordings[0], mapping, data).recording
    asked = " ".join(draft.questions)
    wrong = []

    def compare(key: str, made: np.ndarray | None, true: np.ndarray, slack: float) -> None:
        if made is not None and key not in asked and not np.allclose(made, true, atol=slack):
            wrong.append(f"{key}: off by {np.abs(made - true).max():.3g}")

    if "time" not in asked:
        compare("sources.states.time", recording.states.time, MOTION.time, 1e-6)
    if recording.arm.joints != JOINTS and not all(each.startswith("joint_") for each in recording.arm.joints):
        wrong.append(f"joints: {recording.arm.joints}")
    compare("channels.states.position", recording.states.position, MOTION.position, 2e-3)
    if "channels.states.position" not in asked and "time" not in asked:
        compare("channels.states.velocity", recording.states.velocity, MOTION.velocity, 0.2)
    if recording.command is not None:
        position = (
            "channels.command.position" if "channels.states.position" not in asked else "states.position"
        )
        compare(position, recording.command.position, MOTION.target, 2e-3)
    if recording.commanded_effort is not None:
        compare("channels.commanded_effort.effort", recording.commanded_effort.effort, MOTION.effort, 1e-6)
    if recording.states.effort is not None:
        compare("channels.states.effort", recording.states.effort, MOTION.effort, 1e-6)
    return wrong


@pytest.mark.parametrize(("make", "described"), LOGS, ids=[make.__name__ for make, _ in LOGS])
def test_nothing_is_wrong_in_silence(make: Callable[[Path], Path], described: bool, tmp_path: Path) -> None:
    path = make(tmp_path)
    draft = _made(path, described)
    assert not _wrong_in_silence(draft, path, tmp_path)
    assert draft.channels["states"]["position"]
    (tmp_path / "m.yaml").write_text(as_yaml(draft))
    if draft.questions:
        with pytest.raises(InputError, match="questions of its draft are open"):
            read_mapping(tmp_path / "m.yaml")
    else:
        read_mapping(tmp_path / "m.yaml")


def test_what_each_log_leaves_to_ask(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = {}
    for make, described in LOGS:
        folder = tmp_path / make.__name__
        folder.mkdir()
        draft = _made(make(folder), described)
        table[make.__name__] = sorted({question.split(":")[0] for question in draft.questions})
        assert ("command" in draft.channels) == (make not in (short_csv, ros1_bag)), make.__name__
    with capsys.disabled():
        for name, asked in table.items():
            print(f"\n{name}: {', '.join(asked) or 'nothing'}", end="")
    assert table["snake_csv"] == ["channels.commanded_effort.effort"]
    assert table["ros2_bag"] == table["ros1_bag"] == ["channels.commanded_effort.effort"]
    assert table["degrees_csv"] == ["joints"]


def test_files_with_the_same_columns_are_recordings_of_one_machine(tmp_path: Path) -> None:
    folder = tmp_path / "bench"
    folder.mkdir()
    time = np.arange(0.0, 8.0, 0.01)
    for k, name in enumerate(("slow", "swift", "work")):
        goal = 100.0 * np.sin((1.0 + k) * time)
        force = 3.0 * np.cos(time)
        rate = 100.0 * (1.0 + k) * np.cos((1.0 + k) * time)
        rows = np.column_stack([time, goal, goal + 0.01 * np.sin(9 * time), rate, force])
        head = "Time[s],Target[mm],Actual[mm],Velocity[mm/s],Force[N]"
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=head, comments="", fmt="%.6f")
    draft = draft_mapping([folder], None, None)
    assert [(r["name"], r["role"]) for r in draft.recordings] == [
        ("slow", "fit"), ("swift", "fit"), ("work", "held_out"),
    ]  # fmt: skip
    assert not any("and not" in question for question in draft.questions)
    # A velocity that is not called `actual` beside an actual position is the measured one all the same.
    assert draft.channels["states"]["velocity"]["formula"] == ["velocity_mm_s_1"]
    assert draft.channels["commanded_effort"]["effort"]["formula"] == ["force_n_1"]
    text = as_yaml(draft).replace("questions:", "about:\n  was:", 1).replace("\nabout: D", "\n# D", 1)
    mapping = parse_mapping(text, folder / "m.yaml")
    positions = [import_recording(r, mapping, folder).recording.states.position for r in mapping.recordings]
    assert [np.ptp(p) for p in positions] == pytest.approx([0.2] * 3, rel=0.01)
    with pytest.raises(InputError, match=r"several recordings \(slow, swift, work\)"):
        read_foreign(folder, None, None, Effort.none)


def test_efforts_that_are_stated_leave_nothing_to_ask(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path)
    for effort in (Effort.drive, Effort.link, Effort.none):
        draft = _made(path, False, effort)
        assert not draft.questions
        assert ("effort" in draft.channels["states"]) == (effort is Effort.link)
        assert ("commanded_effort" in draft.channels) == (effort is Effort.drive)


def test_a_foreign_bag_is_read_without_a_mapping(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path)
    assert is_foreign(path)
    recording, notes = read_foreign(path, None, None, Effort.link)
    assert recording.arm.joints == JOINTS
    assert recording.command is not None
    np.testing.assert_allclose(recording.states.position, MOTION.position)
    np.testing.assert_allclose(recording.states.effort, MOTION.effort)
    np.testing.assert_allclose(recording.command.position, MOTION.target)
    assert any("channels.states.effort: /joint_states" in note for note in notes)
    with pytest.raises(InputError, match=r"not all of it is sure:\n  channels.commanded_effort"):
        read_foreign(path, None, None, Effort.ask)


def test_a_velocity_that_is_none_is_not_taken(tmp_path: Path) -> None:
    columns = {"t": MOTION.time, **_by_joint("pos_rad{}", MOTION.position, NUMBERS)}
    path = _csv(tmp_path / "a.csv", columns | _by_joint("vel{}", MOTION.effort, NUMBERS))
    draft = _made(path, False)
    assert draft.channels["states"]["velocity"] == "derivative"
    assert "is not its rate" in as_yaml(draft)


def test_a_log_without_positions_is_refused(tmp_path: Path) -> None:
    path = _csv(tmp_path / "a.csv", {"t": MOTION.time, "temperature": MOTION.time, "fan": MOTION.time**2})
    with pytest.raises(InputError, match=r"no measured position was found among .*temperature"):
        _made(path, False)


def test_a_ros1_bag_with_a_damaged_message_is_refused(tmp_path: Path) -> None:
    """Its reader opens: the index is whole, and only the messages tell."""
    path = ros1_bag(tmp_path)
    data = path.read_bytes()
    at = data.rindex(b"\x04\x00\x00\x00op=\x02")  # of a message in its chunk: the length of a header's field
    path.write_bytes(data[:at] + b"\xff\xff\x00\x00" + data[at + 4 :])
    with pytest.raises(InputError, match="does not fit its type|cannot be read"):
        read_table(path, CsvOptions(), "it", "/joint_states")
