"""The decoder against rosbags' and mcap-ros2-support's."""

from __future__ import annotations

import dataclasses
import re
import struct
from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from samrl_core.common.errors import InputError
from samrl_ros.bags.decode import Decoders, decode
from samrl_ros.bags.schemas import schema_text
from samrl_ros.contract.message_types import message_class

NUMBERS = {
    "bool": "?", "byte": "B", "char": "B", "float32": "f", "float64": "d", "int8": "b", "uint8": "B",
    "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
TYPES = (
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CameraInfo",
    "trajectory_msgs/msg/JointTrajectory",
    "diagnostic_msgs/msg/DiagnosticArray",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "rcl_interfaces/msg/ParameterEvent",
    "tf2_msgs/msg/TFMessage",
    "std_msgs/msg/Empty",
)


def schema_of(name: str, text: str | None = None) -> Schema:
    return Schema(id=1, name=name, encoding="ros2msg", data=(text or schema_text(name)).encode())


def draw(typestore: Any, name: str, rng: np.random.Generator) -> Any:
    """A random message of a rosbags type."""
    values = {field: draw_field(typestore, kind, rng) for field, kind in typestore.fielddefs[name][1]}
    return typestore.types[name](**values)


def draw_field(typestore: Any, kind: Any, rng: np.random.Generator) -> Any:
    node, detail = kind
    if node.name == "BASE":
        return draw_base(detail[0], rng)
    if node.name == "NAME":
        return draw(typestore, detail, rng)
    element, count = detail
    count = count if node.name == "ARRAY" else int(rng.integers(0, 4))
    if element[0].name == "BASE" and element[1][0] != "string":
        dtype = {"byte": "uint8", "octet": "uint8", "char": "uint8"}.get(element[1][0], element[1][0])
        return rng.integers(0, 2, count).astype(dtype) * np.array(1, dtype)
    return [draw_field(typestore, element, rng) for _ in range(count)]


def draw_base(base: str, rng: np.random.Generator) -> Any:
    if base == "string":
        return "".join(chr(int(c)) for c in rng.integers(0x20, 0x250, rng.integers(0, 6)))
    if base == "bool":
        return bool(rng.integers(0, 2))
    if base.startswith("float"):
        return float(np.float32(rng.normal()))
    return int(rng.integers(0, 127))


def plain(value: Any) -> Any:
    """Comparable values out of any decoder's objects."""
    if hasattr(value, "_full_text"):  # mcap-ros2-support's
        return {k: plain(getattr(value, k)) for k in value.__slots__}
    if isinstance(value, SimpleNamespace):
        return {k: plain(v) for k, v in vars(value).items()}
    if dataclasses.is_dataclass(value):  # rosbags'; it counts constants as fields
        names = [f.name for f in dataclasses.fields(value) if f.name[0] != "_" and not f.name.isupper()]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, bytes | array | np.ndarray | list | tuple):
        return [plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("little", [True, False])
def test_equal_to_rosbags(typestore, name: str, little: bool) -> None:
    decoder = Decoders().get("/a", "cdr", schema_of(name))
    rng = np.random.default_rng(3)
    for _ in range(20):
        message = draw(typestore, name, rng)
        data = bytes(typestore.serialize_cdr(message, name, little_endian=little))
        found, expected = plain(decoder(data)), plain(typestore.deserialize_cdr(data, name))
        assert found == expected


@pytest.mark.parametrize("name", TYPES[:4])
def test_equal_to_mcap_ros2_support(typestore, name: str) -> None:
    schema = schema_of(name)
    ours, theirs = Decoders().get("/a", "cdr", schema), DecoderFactory().decoder_for("cdr", schema)
    assert theirs is not None
    rng = np.random.default_rng(4)
    for _ in range(20):
        data = bytes(typestore.serialize_cdr(draw(typestore, name, rng), name))
        assert plain(ours(data)) == plain(theirs(data))


@pytest.mark.parametrize("base", NUMBERS)
def test_every_number_aligned_after_a_byte(base: str) -> None:
    code = NUMBERS[base]
    text = f"uint8 first\n{base} x\nuint8 middle\n{base}[2] pair\n{base}[] many\n{base}[<=4] some\n"
    decoder = Decoders().get("/a", "cdr", schema_of("my_msgs/msg/X", text))
    size = struct.calcsize("=" + code)
    body = b""

    def put(kind: str, value: Any, alignment: int) -> None:
        nonlocal body
        body += bytes(-len(body) % alignment) + struct.pack("<" + kind, value)

    for kind, value in (("B", 7), (code, 1), ("B", 9), (code, 0), (code, 1), ("I", 1), (code, 1), ("I", 0)):
        put(kind, value, 4 if kind == "I" else 1 if kind == "B" else size)
    message = decoder(b"\0\1\0\0" + body)
    assert (message.first, message.x, message.middle) == (7, 1, 9)
    assert (list(message.pair), list(message.many), list(message.some)) == ([0, 1], [1], [])


def test_values_do_not_need_ros(joints_cdr) -> None:
    message = Decoders().get("/a", "cdr", schema_of(TYPES[0]))(joints_cdr(5, 0.25))
    assert np.asarray(message.position).tolist() == [0.25] * 7
    assert message.name[0] == "panda_joint1" and message.header.stamp.nanosec == 5


def test_every_cut_and_an_overlong_message_are_refused(joints_cdr) -> None:
    decoder = Decoders().get("/a", "cdr", schema_of(TYPES[0]))
    data = joints_cdr(5, 0.25)
    for cut in range(len(data)):
        with pytest.raises(InputError, match="/a, log time 12 ns"):
            decode(decoder, "/a", 12, data[:cut])
    for more in range(1, 20):  # the message is a multiple of four already: nobody has a reason to add
        with pytest.raises(InputError, match="left over"):
            decode(decoder, "/a", 12, data + bytes(more))
    with pytest.raises(InputError, match="plain CDR"):
        decode(decoder, "/a", 12, b"\0\x07\0\0" + data[4:])


def random_ros_message(name: str, rng: np.random.Generator) -> Any:
    """A random message of rclpy's classes, with many empty sequences."""
    message = message_class(name)()
    for field, kind in message.get_fields_and_field_types().items():
        setattr(message, field, random_ros_value(kind, getattr(message, field), rng))
    return message


def random_ros_value(kind: str, default: Any, rng: np.random.Generator) -> Any:
    inner, is_sequence = re.subn(r"^sequence<(.*?)(, \d+)?>$", r"\1", kind)
    if is_sequence:
        return [random_ros_value(inner, None, rng) for _ in range(rng.choice((0, 0, 1, 3)))]
    if kind.endswith("]") or kind in ("octet", "char"):
        return default if default is not None else b"\0" if kind == "octet" else 0
    if "/" in kind:
        package, _, type_ = kind.partition("/")
        return random_ros_message(f"{package}/msg/{type_}", rng)
    if kind in ("string", "wstring"):
        return "é" * int(rng.integers(0, 6))
    if kind == "boolean":
        return bool(rng.integers(0, 2))
    return float(np.float32(rng.normal())) if kind in ("float", "double") else int(rng.integers(0, 100))


@pytest.mark.ros
@pytest.mark.parametrize("name", [*TYPES, "visualization_msgs/msg/Marker", "std_msgs/msg/UInt64MultiArray"])
def test_what_rclpy_serialises_is_read_whatever_it_allocated(name: str) -> None:
    rclpy_serialization = pytest.importorskip("rclpy.serialization")
    decoder, rng = Decoders().get("/a", "cdr", schema_of(name)), np.random.default_rng(5)
    for _ in range(100):
        message = random_ros_message(name, rng)
        data = rclpy_serialization.serialize_message(message)
        found = decode(decoder, "/a", 0, data)
        for field in message.get_fields_and_field_types():
            assert str(plain_ros(getattr(message, field))) == str(plain_ros(getattr(found, field)))
        with pytest.raises(InputError, match="left over"):
            decode(decoder, "/a", 0, data + bytes(8))


def plain_ros(value: Any) -> Any:
    """Numbers and lists out of rclpy's or rosbags' objects."""
    if hasattr(value, "get_fields_and_field_types"):
        return [plain_ros(getattr(value, field)) for field in value.get_fields_and_field_types()]
    if dataclasses.is_dataclass(value):
        names = [f.name for f in dataclasses.fields(value) if f.name[0] != "_" and not f.name.isupper()]
        return [plain_ros(getattr(value, name)) for name in names]
    if isinstance(value, array | np.ndarray | list | tuple):
        return [plain_ros(item) for item in value]
    if isinstance(value, bytes | np.generic):
        return value[0] if isinstance(value, bytes) else value.item()
    return value


@pytest.mark.ros
def test_a_trajectory_with_empty_lists_leaves_twelve_bytes() -> None:
    rclpy_serialization = pytest.importorskip("rclpy.serialization")
    name = "trajectory_msgs/msg/JointTrajectory"
    point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")(positions=[1.0, 2.0])
    data = rclpy_serialization.serialize_message(message_class(name)(joint_names=["abc"], points=[point]))
    decoder = Decoders().get("/a", "cdr", schema_of(name))
    assert decode(decoder, "/a", 0, data).points[0].positions.tolist() == [1.0, 2.0]
    decode(decoder, "/a", 0, data[:-12])  # twelve bytes mean nothing
    for left in (4, 8, 11):
        with pytest.raises(InputError, match="left over"):
            decode(decoder, "/a", 0, data[: left - 12])
    with pytest.raises(InputError, match="missing|left over|do not fit"):
        decode(decoder, "/a", 0, data[:-13])
