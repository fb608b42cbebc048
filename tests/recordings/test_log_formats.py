"""Logs as others write them: every kind of bag by rosbags' own writers, LeRobot, HDF5, JSON."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats.control_msgs import RELEASES
from samrl_ros.log_import.formats.parquet import episodes
from samrl_ros.log_import.formats.rosbag import list_topics, read_text_topic
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table

ARM = ("shoulder", "elbow")
COUNT = 30
STATE = "control_msgs/msg/JointTrajectoryControllerState"


def _store(kind: Stores, release: dict[str, str] | None = None) -> Any:
    store = get_typestore(kind)
    for name, text in (release or {}).items():
        store.register(get_types_from_msg(text, name))
    return store


def _header(store: Any, seconds: float, ros1: bool) -> Any:
    whole, rest = int(seconds), round(1e9 * (seconds % 1.0))
    stamp = store.types["builtin_interfaces/msg/Time"](sec=whole, nanosec=rest)
    more = {"seq": 0} if ros1 else {}
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **more)


def _joint_state(store: Any, k: int, names: list[str], ros1: bool) -> Any:
    values = np.array([ord(name[0]) + 0.01 * k for name in names])
    return store.types["sensor_msgs/msg/JointState"](
        header=_header(store, 5.0 + 0.01 * k, ros1),
        name=names,
        position=values,
        velocity=values * 2,
        effort=np.array([]),
    )


def _write(path: Path, kind: str) -> Path:
    """A bag of joint states: two arm joints in changing order, a gripper's messages in between."""
    ros1 = kind == "ros1"
    store = _store(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    writer: Any
    if ros1:
        path = path.with_suffix(".bag")
        writer = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
    encode = store.serialize_ros1 if ros1 else store.serialize_cdr
    with writer:
        to = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        text = writer.add_connection("/robot_description", "std_msgs/msg/String", typestore=store)
        about = store.types["std_msgs/msg/String"](data="<robot/>")
        writer.write(text, 1, encode(about, "std_msgs/msg/String"))
        for k in range(COUNT):
            names = ["gripper"] if k % 3 == 2 else [*ARM][:: -1 if k % 2 else 1]
            message = _joint_state(store, k, names, ros1)
            writer.write(to, 10**9 + k, encode(message, "sensor_msgs/msg/JointState"))
    return path


@pytest.mark.parametrize("kind", ["mcap", "sqlite3", "ros1"])
def test_joint_states_of_every_kind_of_bag(tmp_path: Path, kind: str) -> None:
    path = _write(tmp_path / "log", kind)
    table = read_table(path, CsvOptions(), "it", "/joint_states")
    arm = np.array([k % 3 != 2 for k in range(COUNT)])
    for name in ARM:
        values = table.numbers(f"position.{name}", "it")
        np.testing.assert_allclose(values[arm], ord(name[0]) + 0.01 * np.flatnonzero(arm))
        assert np.isnan(values[~arm]).all()
    assert "effort.shoulder" not in table.columns
    assert table.time is not None
    np.testing.assert_allclose(table.time, 5.0 + 0.01 * np.arange(COUNT), atol=1e-9)
    assert [(t.name, t.count) for t in list_topics(path, "it")] == [
        ("/joint_states", COUNT),
        ("/robot_description", 1),
    ]
    assert read_text_topic(path, "/robot_description", "it") == "<robot/>"
    with pytest.raises(InputError, match="no messages of '/x'; topics are /joint_states"):
        read_table(path, CsvOptions(), "it", "/x")


@pytest.mark.parametrize(("number", "field"), [(0, "actual"), (1, "feedback"), (2, "feedback")])
def test_controller_state_of_every_release_in_bags_without_definitions(
    tmp_path: Path, number: int, field: str
) -> None:
    store = _store(Stores.ROS2_JAZZY, RELEASES[number])
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    duration = store.types["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    free = store.types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]
    with Writer2(tmp_path / "log", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        to = writer.add_connection("/arm/controller_state", STATE, typestore=store)
        for k in range(5):
            fields = {}
            for name, (_, about) in store.fielddefs[STATE][1]:
                kind = about if isinstance(about, str) else ""
                empty = np.array([])
                if kind.endswith("/JointTrajectoryPoint"):
                    values = np.array([k, -k], dtype=float) + (10.0 if name == field else 0.0)
                    fields[name] = point(values, empty, empty, empty, duration)
                elif kind.endswith("MultiDOFJointTrajectoryPoint"):
                    fields[name] = free([], [], [], duration)
            names = {"multi_dof_joint_names": []} if number else {}
            message = store.types[STATE](
                header=_header(store, 1.0 + k, False), joint_names=[*ARM], **names, **fields
            )
            writer.write(to, k + 1, store.serialize_cdr(message, STATE))
    (file,) = (tmp_path / "log").glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM message_definitions")  # as recorders before Iron leave it
    table = read_table(tmp_path / "log", CsvOptions(), "it", "/arm/controller_state")
    assert table.numbers(f"{field}.positions.elbow", "it").tolist() == [10.0 - k for k in range(5)]


def _lerobot(path: Path, version: str) -> Path:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as parquet

    info = {
        "codebase_version": version,
        "total_episodes": 2,
        "fps": 50,
        "features": {
            "observation.state": {"dtype": "float32", "shape": [2], "names": [*ARM]},
            "action": {"dtype": "float32", "shape": [2], "names": {"motors": [*ARM]}},
        },
    }
    (path / "meta").mkdir(parents=True)
    (path / "meta/info.json").write_text(json.dumps(info))
    (path / "data/chunk-000").mkdir(parents=True)
    tables = []
    for episode in range(2):
        values = [[100.0 * episode + k, -k] for k in range(COUNT)]
        tables.append(
            pa.table(
                {
                    "observation.state": values,
                    "action": [[a + 1.0, b] for a, b in values],
                    "timestamp": [k / 50 for k in range(COUNT)],
                    "episode_index": [episode] * COUNT,
                    "task": ["pick"] * COUNT,
                }
            )
        )
    if version == "v3.0":
        parquet.write_table(pa.concat_tables(tables), path / "data/chunk-000/file-000.parquet")
    else:
        for episode, table in enumerate(tables):
            parquet.write_table(table, path / f"data/chunk-000/episode_{episode:06d}.parquet")
    return path


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_episodes_of_a_lerobot_dataset(tmp_path: Path, version: str) -> None:
    path = _lerobot(tmp_path / "set", version)
    table = read_table(path, CsvOptions(), "it", "1")
    assert table.numbers("observation.state.shoulder", "it").tolist() == [100.0 + k for k in range(COUNT)]
    assert table.numbers("action", "it").shape == (COUNT, 2)
    assert table.numbers("action.shoulder", "it")[0] == 101.0
    assert table.time is not None and table.time[1] == pytest.approx(0.02)
    with pytest.raises(InputError, match="has no episode 7; it has 0 to 1"):
        read_table(path, CsvOptions(), "it", "7")
    with pytest.raises(InputError, match="must be an episode's number"):
        read_table(path, CsvOptions(), "it", "")


@pytest.mark.parametrize("total", [10**18, -1, "many", 2.5])
def test_a_dataset_that_claims_too_many_episodes_is_refused(tmp_path: Path, total: object) -> None:
    """As many names as it claims would fill the memory."""
    path = _lerobot(tmp_path / "set", "v3.0")
    info = path / "meta" / "info.json"
    info.write_text(json.dumps({**json.loads(info.read_text()), "total_episodes": total}))
    with pytest.raises(InputError, match=r"info\.json: total_episodes is .*, must be a whole number up to"):
        episodes(path)


def test_groups_of_hdf5(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["data/demo_0/obs/qpos"] = np.arange(12.0).reshape(6, 2)
        file["data/demo_0/obs/images"] = np.zeros((6, 64, 64, 3), dtype=np.uint8)
        file["data/demo_1/action"] = np.zeros(3)
    table = read_table(tmp_path / "a.hdf5", CsvOptions(), "it", "data/demo_0")
    assert table.numbers("obs.qpos", "it").tolist()[1] == [2.0, 3.0]
    assert list(table.columns) == ["obs.qpos"]
    with pytest.raises(InputError, match="has no group 'demo_7'; it has data/demo_0/obs, data/demo_1"):
        read_table(tmp_path / "a.hdf5", CsvOptions(), "it", "demo_7")


@pytest.mark.parametrize(
    ("name", "text", "part"),
    [
        ("a.json", '{"log": {"t": [0, 1], "arm": {"q": [[1, 2], [3, 4]]}}, "robot": "x"}', "log"),
        ("a.json", '[{"t": 0, "arm": {"q": [1, 2]}}, {"t": 1, "arm": {"q": [3, 4]}, "mode": "on"}]', ""),
        ("a.jsonl", '{"t": 0, "arm": {"q": [1, 2]}}\n\n{"t": 1, "arm": {"q": [3, 4]}}\n', ""),
    ],
)
def test_json_in_every_shape(tmp_path: Path, name: str, text: str, part: str) -> None:
    (tmp_path / name).write_text(text)
    table = read_table(tmp_path / name, CsvOptions(), "it", part)
    assert table.numbers("t", "it").tolist() == [0.0, 1.0]
    assert table.numbers("arm.q", "it").tolist() == [[1.0, 2.0], [3.0, 4.0]]


def _refused(path: Path, part: str = "") -> str:
    with pytest.raises(InputError) as caught:
        read_table(path, CsvOptions(), "it", part)
    return str(caught.value)


def test_what_is_no_log_of_its_kind_is_refused(tmp_path: Path) -> None:
    for name in ("a.bag", "a.hdf5", "a.parquet", "a.json", "a.npz"):
        (tmp_path / name).write_bytes(bytes(range(256)) * 4)
        assert "it" in _refused(tmp_path / name, "x" if name in ("a.bag", "a.hdf5") else "")
    (tmp_path / "a.csv").write_text("t\n1\n")
    assert "has no parts" in _refused(tmp_path / "a.csv", "x")
    assert "name the topic with `part`" in _refused(tmp_path / "a.bag")
    (tmp_path / "b").mkdir()
    assert "neither a bag" in _refused(tmp_path / "b")
    (tmp_path / "b/log.db3").write_bytes(b"SQLite format 3\0")
    assert "no metadata.yaml" in _refused(tmp_path / "b/log.db3", "/x")
    (tmp_path / "a.xyz").write_text("")
    assert "of unknown kind" in _refused(tmp_path / "a.xyz")
    (tmp_path / "n.json").write_text('{"a": 1}')
    assert "has no 'b' of part 'b'" in _refused(tmp_path / "n.json", "b")


def test_a_table_without_time_says_so(tmp_path: Path) -> None:
    assert Table(tmp_path).time is None


def test_a_list_of_episodes_is_no_list_of_samples(tmp_path: Path) -> None:
    """Lists of signals, as those who train on them write a JSON file, without a time."""
    one = {"type": "drop", "actions": [0.0] * 30 + [None] * 20, "sensor_data": [0.01 * k for k in range(50)]}
    path = tmp_path / "responses.json"
    path.write_text(json.dumps({"config": {"action_hz": 50, "limits": [-0.6, 0.6]}, "data": [one, one]}))
    table = read_table(path, CsvOptions(), "it")
    assert [len(table.numbers(name, "it")) for name in ("actions", "sensor_data")] == [50, 50]
    assert table.notes == ["responses.json holds 2 episodes; the first is read, `part` names others"]
    assert len(read_table(path, CsvOptions(), "it", "data.1").numbers("sensor_data", "it")) == 50
