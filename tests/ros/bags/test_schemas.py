"""Definitions and type hashes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from samrl_core.common.errors import InputError
from samrl_ros.bags import schemas
from samrl_ros.bags.type_hash import fields, rihs01
from samrl_ros.contract.topics import TOPICS

SHARE = Path(sys.prefix) / "share"
RULER = "=" * 80


def test_schema_text_of_a_nested_type_is_rosbag2s() -> None:
    """Depth first in sorted order, each type once; the order decides whether two recorders agree."""
    text = schemas.schema_text("trajectory_msgs/msg/JointTrajectory")
    order = [line[5:] for line in text.splitlines() if line.startswith("MSG: ")]
    assert order == [
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "trajectory_msgs/JointTrajectoryPoint",
        "builtin_interfaces/Duration",
    ]
    assert f"\n{RULER}\nMSG: std_msgs/Header\n" in text


def test_nested_types_are_sorted_by_name() -> None:
    text = schemas.schema_text("sensor_msgs/msg/CameraInfo")
    order = [line[5:] for line in text.splitlines() if line.startswith("MSG: ")]
    assert order == ["sensor_msgs/RegionOfInterest", "std_msgs/Header", "builtin_interfaces/Time"]


@pytest.mark.skipif(not (SHARE / "std_msgs").is_dir(), reason="no ROS packages installed")
def test_root_text_is_the_installed_file_byte_for_byte() -> None:
    for name in ("Image", "JointState", "CameraInfo"):
        file = SHARE / "sensor_msgs" / "msg" / f"{name}.msg"
        text = schemas.schema_text(f"sensor_msgs/msg/{name}").encode()
        assert text.startswith(file.read_bytes() + b"\n" + RULER.encode())


@pytest.mark.thorough
@pytest.mark.skipif(not (SHARE / "std_msgs").is_dir(), reason="no ROS packages installed")
def test_computed_hashes_equal_all_installed_ones() -> None:
    checked = 0
    for file in sorted(SHARE.glob("*/msg/*.json")):
        name = f"{file.parent.parent.name}/msg/{file.stem}"
        if not file.with_suffix(".msg").exists():
            continue
        entries = json.loads(file.read_text())["type_hashes"]
        expected = next(e["hash_string"] for e in entries if e["type_name"] == name)
        assert rihs01(name, schemas.message_text) == expected, name
        checked += 1
    assert checked > 50


def test_hashes_equal_those_of_rosbags(typestore) -> None:
    for name in (
        "sensor_msgs/msg/JointState",
        "trajectory_msgs/msg/JointTrajectory",
        "sensor_msgs/msg/Image",
    ):
        assert rihs01(name, schemas.message_text) == typestore.hash_rihs01(name)


def test_every_topic_of_the_cell_has_a_definition() -> None:
    for topic in TOPICS.values():
        described = schemas.definition(topic.type)
        assert described.text and described.type_hash.startswith("RIHS01_"), topic.name


def test_without_ros_the_typestore_gives_the_same_fields_and_hash(monkeypatch) -> None:
    name = "trajectory_msgs/msg/JointTrajectory"
    expected, hashed = fields(name, schemas.message_text(name)), schemas.type_hash(name)
    monkeypatch.setattr(schemas, "_installed_text", lambda _: None)
    monkeypatch.setattr(schemas, "_folders", lambda _: [])
    assert fields(name, schemas.message_text(name)) == expected
    assert schemas.type_hash(name) == hashed


def test_own_prefix_is_searched_first(tmp_path: Path, monkeypatch) -> None:
    folder = tmp_path / "share" / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Pair.msg").write_bytes(b"float64 a\r\nfloat64 b\r\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert schemas.schema_text("my_msgs/msg/Pair") == "float64 a\r\nfloat64 b\r\n"


@pytest.mark.parametrize("name", ["no_such_msgs/msg/Thing", "std_msgs/msg/Strnig"])
def test_unknown_type_is_refused_with_a_remedy(name: str) -> None:
    with pytest.raises(InputError, match="install the ROS package"):
        schemas.definition(name)


@pytest.mark.parametrize("name", ["String", "std_msgs/String", "../msg/x", "", "std_msgs/srv/Trigger"])
def test_malformed_type_name_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="package/msg/Name"):
        schemas.definition(name)
