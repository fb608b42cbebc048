"""Files that nobody wrote as asked: a refusal with a remedy, no traceback, hang or file of others."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from samrl_core.cell.excitation.trajectory_file import TrajectoryFile
from samrl_core.cell.robots.urdf import read_urdf
from samrl_core.cell.robots.urdf_text import parse_urdf
from samrl_core.common.array_file import unpacked
from samrl_core.common.errors import InputError
from samrl_core.common.text_files import parse_json, parse_yaml, read_text
from samrl_ros.bags.metadata import load
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.writer import BagWriter
from samrl_ros.cell.parameter_file import load_parameters
from samrl_ros.cli.diagnosis.library import read_library
from samrl_ros.cli.main import run
from samrl_ros.log_import.mapping import read_mapping
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from samrl_ros.recordings.joint_messages import encode_text
from samrl_ros.recordings.nominal_texts import parse_controller, parse_tool, read_tolerances

URDF = (
    '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    '<limit lower="-2" upper="2" effort="9" velocity="3"/></joint></robot>'
)
READERS: dict[str, Callable[[Path], Any]] = {
    "urdf": read_urdf,
    "mapping": read_mapping,
    "tolerances": read_tolerances,
    "trajectory": TrajectoryFile.read,
    "library": read_library,
    "parameters": lambda path: load_parameters(path, ("policy",)),
    "bag": open_bag,
    "text": lambda path: read_text(path, "the text"),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_is_no_file(reader: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError):
        READERS[reader](tmp_path / "pipe")


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", ["x" * 5000, "null\0byte", "no/such/folder"])
def test_paths_that_no_file_has(reader: str, name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        READERS[reader](tmp_path / name)


@pytest.mark.parametrize("reader", [name for name in READERS if name != "bag"])
@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_other_encodings_are_named(reader: str, encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?><robot name="é"/>'.encode(encoding))
    with pytest.raises(InputError, match="UTF-8"):
        READERS[reader](file)


@pytest.mark.parametrize("reader", ["mapping", "tolerances", "trajectory", "library", "parameters"])
@pytest.mark.parametrize(
    "text",
    [
        "[" * 5_000,
        "{a: " * 300 + "1" + "}" * 300,
        "&a [*a]",
        "a: !!bool maybe",
        "a: !!timestamp never",
        "a: 2026-99-99",
        "a: !!int ''",
        "a: &a [1,1]\nb: &b [*a,*a]\n"
        + "".join(
            f"{c}: &{c} [{', '.join([f'*{p}'] * 20)}]\n" for p, c in zip("bcdefgh", "cdefghi", strict=True)
        ),
    ],
    ids=["deep", "deep mapping", "cycle", "bool", "timestamp", "date", "int", "billion laughs"],
)
def test_yaml_that_breaks_its_reader(reader: str, text: str, tmp_path: Path) -> None:
    file = tmp_path / "file.yaml"
    file.write_text(text)
    with pytest.raises(InputError):
        READERS[reader](file)


@pytest.mark.parametrize("name", ["x.npy", "x.npz"])
def test_an_array_whose_header_is_no_python(name: str, tmp_path: Path) -> None:
    """NumPy's own reader lets `tokenize.TokenError` out."""
    with io.BytesIO() as buffer:
        np.save(buffer, np.zeros(3))
        array = buffer.getvalue()
    array = array[:10] + b"{'descr': '<".ljust(118, b"a") + array[128:]  # neither string nor dict ends
    content = array
    if name.endswith("npz"):
        with io.BytesIO() as buffer:
            with zipfile.ZipFile(buffer, "w") as archive:
                archive.writestr("t.npy", array)
            content = buffer.getvalue()
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match="cannot be read"):
        read_table(tmp_path / name, CsvOptions(), "it")
    if name.endswith("npz"):
        with pytest.raises(InputError, match="cannot be read"):
            unpacked(content, tmp_path / name)


def test_json_nested_beyond_measure() -> None:
    for depth in (100, 100_000):
        with pytest.raises(InputError, match="nested"):
            parse_json("[" * depth + "]" * depth, "it")
    assert parse_json('{"a": [1]}', "it") == {"a": [1]}
    assert parse_yaml("a: &a [1]\nb: *a", "it") == {"a": [1], "b": [1]}
    assert parse_yaml("", "it") is None


def test_a_urdf_nested_20000_deep(tmp_path: Path) -> None:
    file = tmp_path / "deep.urdf"
    file.write_text("<robot>" + "<a>" * 20_000 + "</a>" * 20_000 + "</robot>")
    with pytest.raises(InputError, match="64 elements deep"):
        read_urdf(file)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        *(('mass value="1"', f'mass value="{bad}"', "mass") for bad in ("nan", "-1", "1e300", "inf", "a")),
        *(('ixx="1"', f'ixx="{bad}"', "ixx") for bad in ("nan", "-1", "1e300")),
        *(('xyz="0 0 1"', f'xyz="{bad}"', "axis") for bad in ("0 0 0", "nan 0 1", "1 2")),
        ('lower="-2"', 'lower="nan"', "lower"),
        ('lower="-2"', 'lower="3"', "above the upper"),
        ('joint name="j"', "joint", "without a name"),
        ('link name="a"', 'link name="b"', "twice"),
        ('link name="a"', 'link name="a\0"', "well-formed"),
    ],
)
def test_figures_that_no_arm_has(old: str, new: str, said: str) -> None:
    parse_urdf(URDF, "it")
    with pytest.raises(InputError, match=said):
        parse_urdf(URDF.replace(old, new, 1), "it")


@pytest.mark.parametrize("mass", [1e300, float("nan"), -1.0, 1e7])
def test_a_tool_of_no_such_mass(mass: float) -> None:
    with pytest.raises(InputError, match="mass"):
        parse_tool(json.dumps({"mass": mass, "center_of_mass": [0, 0, 0]}), "it")


def test_a_controller_with_absurd_figures() -> None:
    text = '{"joints": ["j"], "stiffness": [1e300], "damping": [1]}'
    with pytest.raises(InputError, match="stiffness"):
        parse_controller(text, "it")


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/cell/phase", "std_msgs/msg/String")
        writer.write("/cell/phase", 1, encode_text("x"))
    return tmp_path / "bag"


def change(bag: Path, **entries: Any) -> None:
    content = {"rosbag2_bagfile_information": load(bag)}
    content["rosbag2_bagfile_information"].update(entries)
    (bag / "metadata.yaml").write_text(yaml.safe_dump(content))


@pytest.mark.parametrize("name", ["../x.mcap", "/tmp/x.mcap", "a/../../x.mcap", {"a": 1}, 3, "", "x\0.mcap"])
def test_a_bag_names_no_file_of_others(bag: Path, name: Any) -> None:
    (bag / "bag_0.mcap").rename(bag.parent / "x.mcap")
    change(bag, relative_file_paths=[name])
    with pytest.raises(InputError, match="samrl bag repair"):
        open_bag(bag)


@pytest.mark.parametrize(
    "key", ["storage_identifier", "compression_mode", "relative_file_paths", "topics_with_message_count"]
)
def test_metadata_with_a_mapping_where_text_belongs(bag: Path, key: str) -> None:
    change(bag, **{key: {"a": {"b": 1}}})
    with pytest.raises(InputError, match=key):
        open_bag(bag)


def test_metadata_with_odd_topics_is_read(bag: Path) -> None:
    odd = [{"topic_metadata": {"name": {"a": 1}}}, {"topic_metadata": 3}, 5]
    change(bag, topics_with_message_count=odd)
    assert open_bag(bag).message_count == 1


def test_a_pipe_in_a_bag(bag: Path) -> None:
    (bag / "bag_0.mcap").unlink()
    os.mkfifo(bag / "bag_0.mcap")
    with pytest.raises(InputError, match="pipe"):
        open_bag(bag)


@pytest.mark.parametrize(
    ("begins", "said"),
    [
        (b"SQLite format 3\0", "SQLite"),
        (b"#ROSBAG V2.0\n", "ROS 1"),
        (b"\x28\xb5\x2f\xfd", "zstd"),
        (b"\x1f\x8b", "gzip"),
    ],
)
def test_bags_of_another_format_are_named(begins: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / "bag.mcap").write_bytes(begins + bytes(200))
    with pytest.raises(InputError, match=said):
        open_bag(tmp_path / "bag.mcap")


def test_service_events_and_foreign_formats_are_told(tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "mixed.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        for topic, name, encoding, schema in (
            ("/cell/reset/_service_event", "std_srvs/srv/Trigger_Event", "cdr", "ros2msg"),
            ("/plot", "plot", "json", "jsonschema"),
            ("/cell/phase", "std_msgs/msg/String", "cdr", "ros2msg"),
        ):
            number = writer.register_schema(name, schema, b"string data")
            channel = writer.register_channel(topic, encoding, number)
            writer.add_message(channel, 5, encode_text("x"), 5)
        writer.finish()
    notes = open_bag(tmp_path / "mixed.mcap").notes
    assert any("service events on /cell/reset/_service_event" in note for note in notes)
    assert any("/plot is in json with schema jsonschema" in note for note in notes)
    assert not any("/cell/phase" in note for note in notes)


@pytest.mark.parametrize("how", ["jump", "two clocks in one block"])
def test_a_bag_of_27_hours_is_told(tmp_path: Path, how: str) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/cell/phase", "std_msgs/msg/String")
        for k in range(20):
            ahead = 100_000 if (k == 10 if how == "jump" else k % 2) else 0
            writer.write("/cell/phase", (k + ahead) * 10**9, encode_text("x"))
            if how == "jump":
                writer.split()
    (note,) = open_bag(tmp_path / "bag").notes
    assert "log time jumps by" in note and "27.8 h" in note and "/clock" in note
    for verify in (True, False):
        assert open_bag(tmp_path / "bag", verify).notes == (note,)


@pytest.mark.parametrize("chunks", [True, False])
def test_a_time_beyond_that_of_ros_is_damage(tmp_path: Path, chunks: bool) -> None:
    from mcap.writer import Writer

    with (tmp_path / "late.mcap").open("wb") as stream:
        writer = Writer(stream, use_chunking=chunks)
        writer.start(profile="ros2")
        number = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/cell/phase", "cdr", number)
        for time_ns in (5, 2**63):
            writer.add_message(channel, time_ns, encode_text("x"), time_ns)
        writer.finish()
    bag = open_bag(tmp_path / "late.mcap", verify=True)
    assert bag.truncated and "9223372036854775808 ns" in bag.damage[0]


def test_an_unknown_role_of_an_arm(tmp_path: Path) -> None:
    entry = {"name": "one", "joints": ["j"], "arm": "left_arm"}
    log = {"file": "a.csv", "time": {"column": "t"}, "columns": {"q": "q"}}
    content = {"recordings": [entry], "sources": {"log": log}, "channels": {"states": {"position": ["q"]}}}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match="arm is 'left_arm', must be one of tool_arm, camera_arm"):
        read_mapping(tmp_path / "m.yaml")
    entry |= {"arm": "tool_arm", "name": "a\0b"}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match="name"):
        read_mapping(tmp_path / "m.yaml")


@pytest.mark.parametrize(
    "command",
    [
        ["bag", "info"],
        ["bag", "repair"],
        ["bag", "import", "--check"],
        ["diagnose"],
        ["replay"],
    ],
)
def test_commands_refuse_a_path_of_5000_letters(command: list[str], capfd: Any) -> None:
    assert run([*command, "x" * 5000]) == 3
    assert "Traceback" not in capfd.readouterr().err


def test_a_list_of_recordings_names_only_files_beside_it(tmp_path: Path, capfd: Any) -> None:
    for content in ("[" * 2000, "[]", '{"fit": 3}', '{"fit": ["../x.mcap"]}', '{"fit": [{}]}'):
        (tmp_path / "recordings.json").write_text(content)
        assert run(["diagnose", str(tmp_path), "--out", str(tmp_path / "out")]) == 3, content
        assert "recordings.json" in capfd.readouterr().err
