"""The recorder's logic, and what it must not tell."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError, LimitError
from samrl_ros.bags import play, recorder
from samrl_ros.bags.qos_metadata import PROFILES, QoS, topic_qos
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.recorder import Recorder, clock_ns, header_stamp_ns
from samrl_ros.bags.writer import BagWriter
from samrl_ros.contract.topics import TOPICS

STRING = "std_msgs/msg/String"
JOINTS = "sensor_msgs/msg/JointState"
LATCHED = QoS(durability="transient_local", depth=1)


def test_messages_before_the_clock_are_held(tmp_path: Path, string_cdr) -> None:
    rec = Recorder(BagWriter(tmp_path / "bag"))
    rec.on_raw("/tool", STRING, LATCHED, string_cdr("first"), None)
    rec.on_raw("/phase", STRING, QoS(), string_cdr("second"), None, 5)
    assert rec.status()["held before clock"] == "2"
    rec.on_raw("/phase", STRING, QoS(), string_cdr("third"), 4_000_000, 3_999_000)
    rec.on_raw("/phase", STRING, QoS(), string_cdr("fourth"), 3_000_000)
    assert rec.status()["clock went back"] == "1"
    rec.close()
    found = [(m.data, r.log_time_ns, r.publish_time_ns) for r, m in open_bag(tmp_path / "bag").decoded()]
    assert found == [
        ("fourth", 3_000_000, 3_000_000),
        ("first", 4_000_000, 4_000_000),
        ("second", 4_000_000, 5),
        ("third", 4_000_000, 3_999_000),
    ]
    assert open_bag(tmp_path / "bag").topic("/tool").qos == (LATCHED,)


def test_without_any_clock_nothing_is_lost(tmp_path: Path, string_cdr) -> None:
    rec = Recorder(BagWriter(tmp_path / "bag"))
    rec.on_raw("/tool", STRING, LATCHED, string_cdr("only"), None)
    rec.close()
    rec.close()
    assert [(m.data, r.log_time_ns) for r, m in open_bag(tmp_path / "bag").decoded()] == [("only", 0)]


def test_a_graph_without_clock_does_not_fill_memory(tmp_path: Path, string_cdr, monkeypatch) -> None:
    monkeypatch.setattr(recorder, "HELD_LIMIT", 3)
    rec = Recorder(BagWriter(tmp_path / "bag"))
    for _ in range(3):
        rec.on_raw("/a", STRING, QoS(), string_cdr("x"), None)
    with pytest.raises(LimitError, match="use_sim_time"):
        rec.on_raw("/a", STRING, QoS(), string_cdr("x"), None)
    rec.close()
    assert open_bag(tmp_path / "bag").message_count == 3


def test_split(tmp_path: Path, string_cdr) -> None:
    rec = Recorder(BagWriter(tmp_path / "bag"))
    rec.on_raw("/a", STRING, QoS(), string_cdr("x"), 1)
    assert rec.split().endswith("bag_1.mcap")
    rec.on_raw("/a", STRING, QoS(), string_cdr("y"), 2)
    rec.close()
    assert [m.data for _, m in open_bag(tmp_path / "bag").decoded()] == ["x", "y"]


def test_stamps_from_bytes(joints_cdr, string_cdr) -> None:
    assert header_stamp_ns(JOINTS, joints_cdr(3_000_000_017, 0.0)) == 3_000_000_017
    assert header_stamp_ns(JOINTS, joints_cdr(0, 0.0)) is None
    assert header_stamp_ns(STRING, string_cdr("a long enough text")) is None
    assert header_stamp_ns("tf2_msgs/msg/TFMessage", bytes(40)) is None  # an array of stamped ones
    assert clock_ns(play.clock_bytes(7_000_000_001)) == 7_000_000_001
    assert clock_ns(play.clock_bytes(0)) is None
    big_endian = b"\0\0\0\0" + (2).to_bytes(4, "big") + (5).to_bytes(4, "big")
    assert clock_ns(big_endian) == 2_000_000_005


def test_every_profile_of_the_table_is_known() -> None:
    assert {t.qos for t in TOPICS.values()} <= set(PROFILES)
    assert topic_qos("/cell/tool_arm/robot_description").latched
    with pytest.raises(InputError, match="not in the cell's table"):
        topic_qos("/elsewhere")


def test_no_recorded_topic_tells_the_truth() -> None:
    for topic in TOPICS.values():
        assert not any(word in topic.name for word in ("truth", "seed", "evaluation"))


def test_bags_are_read_without_ros() -> None:
    """Only the player may import ROS, and only when it plays."""
    folder = Path(recorder.__file__).parent
    for file in folder.glob("*.py"):
        for node in ast.parse(file.read_text()).body:  # top level
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not any(name.split(".")[0] in ("rclpy", "rosbags", "foxglove") for name in names), file


def test_a_second_clock_is_told_and_counted(tmp_path: Path, string_cdr) -> None:
    told: list[str] = []
    with BagWriter(tmp_path / "bag") as writer:
        rec = Recorder(writer, told.append)
        for k in range(10):
            clock_s = 100_000 if k % 2 else k + 1  # another node publishes /clock, too
            rec.on_raw("/cell/phase", STRING, QoS(), string_cdr("x"), clock_s * 10**9)
        status = rec.status()
        rec.close()
    assert status["clock jumped"] == "9"
    assert len(told) == 1 and "jumped by +99999.0 s" in told[0] and "/clock" in told[0]
