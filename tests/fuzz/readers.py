"""Everything that takes bytes from outside, each with sound inputs to start from."""

from __future__ import annotations

import dataclasses
import io
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import yaml
from mcap.writer import CompressionType, Writer

from samrl_core.cell.excitation.trajectory_file import TrajectoryFile
from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.robots.urdf import read_urdf
from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.report.json_report import read_report
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.bags.qos_metadata import load_profiles
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.schemas import definition
from samrl_ros.bags.writer import BagWriter
from samrl_ros.cell.parameter_file import load_parameters
from samrl_ros.cli.diagnosis.library import read_library
from samrl_ros.conversions import from_message
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.log_import.draft.joints.joint_draft import draft_mapping
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.rosbag import list_topics
from samrl_ros.log_import.formulas import evaluate
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from samrl_ros.nodes.registry import all_settings
from samrl_ros.recordings import load_recordings
from samrl_ros.recordings.joint_messages import JOINT_STATE, decode_topic, encode_text, encode_topic
from samrl_ros.recordings.nominal_texts import TOLERANCE_FILE, parse_controller, parse_tool, read_tolerances
from tests.fuzz.depth_and_frames import DEPTH_AND_FRAMES
from tests.fuzz.files_of_cells import FILES_OF_CELLS
from tests.fuzz.log_files import (
    columns,
    put_metadata_beside,
    write_csv,
    write_hdf5,
    write_joint_rows,
    write_mat,
    write_messages,
    write_npz,
    write_parquet,
    write_ros_bag,
    write_teleplot,
)
from tests.fuzz.other_kinds import OTHER_KINDS
from tests.fuzz.reader import Reader, text_reader
from tests.fuzz.tracks_of_bodies import TRACKS_OF_BODIES
from tests.learning.data.test_damaged_files import KINDS

URDF = (
    '<?xml version="1.0"?><robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="0 0 0.1"/>'
    '<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1" rpy="0 0 0"/>'
    '<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9" velocity="3"/></joint></robot>'
)


def _table(path: Path) -> None:
    read_table(path, CsvOptions(), "it")


def _topics(path: Path) -> None:
    list_topics(path, "it")
    read_table(path, CsvOptions(), "it", "/joint_states")


def _draft(path: Path) -> None:
    as_yaml(draft_mapping([path], None, None))


def _mapping() -> bytes:
    log = {"file": "a.csv", "time": {"column": "t"}, "columns": {"q": "q"}, "values": {"d": "2 * q"}}
    content = {
        "joints": ["j"],
        "urdf": URDF,
        "controller": {"stiffness": [100.0], "damping": [5.0], "between_commands": "held"},
        "tool": {"mass": 1.0, "center_of_mass": [0, 0, 0.1]},
        "tolerances": {"mass": 0.02},
        "constants": {"k": [1.0, 2.0]},
        "sources": {"log": log},
        "channels": {"states": {"position": ["d / 2"], "velocity": "derivative"}},
        "recordings": [{"name": "one", "arm": "tool_arm", "role": "fit"}],
    }
    return yaml.safe_dump(content).encode()


def _import(path: Path) -> None:
    (path.parent / "a.csv").write_bytes(write_csv())
    import_any(path, path.parent, None)


def _bag(chunks: bool) -> bytes:
    """The topics of an arm, small enough to be read thousands of times."""
    buffer = io.BytesIO()
    writer = Writer(
        buffer,
        use_chunking=chunks,
        compression=CompressionType.NONE,
        enable_crcs=False,
        enable_data_crcs=False,
    )
    writer.start(profile="ros2")
    time, q = columns().values()
    texts = {"robot_description": URDF, "controller": _controller(), "tool": '{"mass": 1, "com": [0, 0, 0]}'}
    string, states = definition("std_msgs/msg/String"), definition(JOINT_STATE)
    number = writer.register_schema(string.type, string.encoding, string.text.encode())
    for name, text in texts.items():
        channel = writer.register_channel(f"/cell/tool_arm/{name}", "cdr", number)
        writer.add_message(channel, 10**9, encode_text(text), 10**9)
    number = writer.register_schema(states.type, states.encoding, states.text.encode())
    channel = writer.register_channel("/cell/tool_arm/joint_states", "cdr", number)
    stamps = (time * 1e9).astype(np.int64) + 10**9
    for stamp, data in zip(
        stamps, encode_topic(JOINT_STATE, stamps, ["j"], {"position": q[:, None]}), strict=True
    ):
        writer.add_message(channel, int(stamp), data, int(stamp))
    writer.finish()
    return buffer.getvalue()


def _read_bag(path: Path) -> None:
    bag = open_bag(path)
    assert isinstance(bag.notes, tuple)
    for _ in bag.decoded():
        pass


def _write_bag(metadata: Path) -> None:
    with BagWriter(metadata.parent) as writer:
        writer.add_topic("/cell/phase", "std_msgs/msg/String")
        writer.write("/cell/phase", 1, encode_text("x"))


def _metadata() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        _write_bag(Path(folder) / "bag" / "metadata.yaml")
        return [(Path(folder) / "bag" / "metadata.yaml").read_bytes()]


def _controller() -> str:
    about = {
        "type": "joint_impedance",
        "joints": ["j"],
        "stiffness": [100],
        "damping": [5],
        "period_s": 0.001,
    }
    more = {"gravity": [0, 0, -9.81], "effort_limit": [9], "armature": [0.1], "tolerances": {"mass": 0.02}}
    return json.dumps({**about, "gravity_compensation": True, "between_commands": "held", **more})


def _decode(path: Path) -> None:
    decode_topic(JOINT_STATE, "it", [path.read_bytes()])


def _messages() -> list[bytes]:
    numbers = {q: np.ones((1, 2)) for q in ("position", "velocity", "effort")}
    return encode_topic(JOINT_STATE, np.array([7]), ["a", "b"], numbers)


def _calibration() -> str:
    pose = {"position": [0.0, 0.0, 1.0], "quat_xyzw": [0.0, 0.0, 0.0, 1.0]}
    return json.dumps({"camera_in_flange": pose, "base_in_world": {"tool_arm": pose, "camera_arm": pose}})


def _announcement() -> str:
    return json.dumps({"task": "peg_insertion", "version": 1, "file": "/tmp/x", "sha256": "ab", "steps": 3})


def _from_fields(path: Path) -> None:
    """Messages of every conversion, with fields out of JSON: right types as ROS sends them, odd values."""
    try:
        about = json.loads(path.read_bytes())
        names, floats, numbers, data = (list(about[k]) for k in ("names", "floats", "numbers", "data"))
        floats = [float(v) for v in floats]
        numbers = [int(v) % 2**32 for v in numbers] + [0] * 8
        data = bytes(int(v) % 256 for v in data)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return  # no message that ROS would hand over
    names, encoding = [str(n) for n in names], str(about.get("encoding"))
    header = SimpleNamespace(stamp=SimpleNamespace(sec=numbers[0] % 2**31, nanosec=numbers[1]))
    point = SimpleNamespace(positions=floats, velocities=floats[:2], accelerations=[], effort=floats)
    xyzw = [*floats, 0.0, 0.0, 0.0, 0.0][:4]
    turned = SimpleNamespace(**dict(zip("xyzw", xyzw, strict=True)))
    roi = SimpleNamespace(x_offset=numbers[4], y_offset=numbers[5])
    size = {"width": numbers[2], "height": numbers[3]}
    tries: list[Callable[[], Any]] = [
        lambda: from_message.arm_reading(
            SimpleNamespace(header=header, name=names, position=floats, velocity=floats, effort=floats),
            ("a", "b"),
        ),
        lambda: from_message.arm_command(
            SimpleNamespace(header=header, joint_names=names, points=[point] * (numbers[6] % 3)), ("a", "b")
        ),
        lambda: from_message.image(
            SimpleNamespace(
                encoding=encoding, step=numbers[4], data=data, is_bigendian=numbers[5] % 2, **size
            )
        ),
        lambda: from_message.intrinsics(
            SimpleNamespace(
                d=floats[9:], distortion_model=encoding, binning_x=numbers[6], binning_y=numbers[7], roi=roi,
                k=floats[:9], **size,
            )
        ),
        lambda: from_message.pose(SimpleNamespace(position=turned, orientation=turned)),
        lambda: from_message.model_values(
            SimpleNamespace(names=names, values=floats[:2], covariance=floats), ("a", "b")
        ),
    ]  # fmt: skip
    for one in tries:
        try:
            one()
        except InputError:
            continue


def _fields() -> list[bytes]:
    image = {"names": ["a", "b"], "floats": [1, 0, 0, 0, 1, 0, 0, 0, 1], "numbers": [1, 2, 4, 2, 12, 0, 1, 0]}
    return [
        json.dumps({**image, "data": [7] * 24, "encoding": encoding}).encode()
        for encoding in ("rgb8", "16UC1", "plumb_bob")
    ] + [json.dumps({**image, "floats": [0.1, 0.2], "data": [], "encoding": ""}).encode()]


def _parameters() -> bytes:
    values = {
        f.name: list(f.default) if isinstance(f.default, tuple) else f.default
        for f in dataclasses.fields(all_settings()["policy"])
    }
    return yaml.safe_dump({"/cell/policy": {"ros__parameters": values}}).encode()


TRAJECTORY = b"schema: 1\narm: tool_arm\nkind: chirp\njoints: [panda_joint1]\nparameters: {}\nwhy: because\n"
FORMULA = b"where(q > 0.5, sin(2 * pi * q), -clip(q / 3, -1, 1)) ** 2 + shift(q, 3) % 7 + unwrap(q, 6)"


def _formula(text: str) -> None:
    q = np.linspace(0, 1, 20)
    evaluate(text, {"q": q, "m": np.eye(2), "x": np.ones((20, 2))}, "it")


def _urdf(path: Path) -> None:
    read_urdf(path)
    arm = ArmDescription("tool_arm", ("j",), path.read_text(encoding="utf-8-sig"), None)
    RigidArm(arm).gravity(np.zeros((1, 1)))


def _damageable() -> Iterator[Reader]:
    """Weights, checkpoints, replays, shards and what else training leaves."""
    for kind in KINDS:
        name = f"training: {kind.name}"
        yield Reader(name, kind.name, lambda kind=kind: [_written(kind)], kind.read, prepare=kind.write)


def _written(kind: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / kind.name
        kind.write(path)
        return path.read_bytes()


def _roles(path: Path) -> None:
    from samrl_ros.cli.diagnosis.load import _role_table

    _role_table(path)


READERS: tuple[Reader, ...] = (
    Reader("bag", "bag.mcap", lambda: [_bag(True), _bag(False)], _read_bag),
    Reader("recording", "bag.mcap", lambda: [_bag(False)], load_recordings),
    Reader(
        "metadata.yaml",
        "bag/metadata.yaml",
        _metadata,
        lambda path: open_bag(path.parent),
        prepare=_write_bag,
    ),
    Reader(
        "QoS of a channel",
        "qos",
        lambda: [b"- {history: 1, depth: 5, reliability: 1, durability: 2}"],
        text_reader(load_profiles),
    ),
    Reader("joint messages", "message", _messages, _decode),
    Reader("messages", "fields.json", _fields, _from_fields),
    Reader("mapping", "m.yaml", lambda: [_mapping()], _import),
    Reader("table CSV", "a.csv", lambda: [write_csv(), b't,q\n1,"[1, 2]"\n2,"[3, 4]"\n'], _table),
    Reader("table NPZ", "a.npz", lambda: [write_npz()], _table),
    Reader("table MAT", "a.mat", lambda: [write_mat()], _table, share=0.1),
    Reader("table HDF5", "a.h5", lambda: [write_hdf5()], _table),
    Reader("table Parquet", "a.parquet", lambda: [write_parquet()], _table),
    Reader(
        "table YAML",
        "a.yaml",
        lambda: [b"%YAML:1.0\n---\nT_0: !!opencv-matrix\n  {rows: 1, cols: 3, data: [1, 2, 3]}\n"],
        _table,
    ),
    Reader("table JSON", "a.json", lambda: [b'[{"t": 1, "a": {"q": [1, 2]}}, {"t": 2}]'], _table),
    Reader("ROS 1 bag", "a.bag", lambda: [write_ros_bag("a.bag")], _topics, share=0.3),
    Reader(
        "sqlite3 bag",
        "log/log.db3",
        lambda: [write_ros_bag("log")],
        lambda path: _topics(path.parent),
        share=0.3,
        prepare=put_metadata_beside,
    ),
    Reader(
        "draft of a CSV",
        "a.csv",
        lambda: [
            write_csv(),
            write_csv().replace(b"q", b"q_deg1"),
            write_joint_rows(),
            write_messages(),
            write_teleplot(),
        ],
        _draft,
        share=0.1,
    ),
    Reader(
        "formula",
        "f",
        lambda: [FORMULA, b"solve(m, x)[1] + apply(m, x)[0] + signed(q, 3)"],
        text_reader(_formula),
    ),
    Reader("URDF", "a.urdf", lambda: [URDF.encode()], _urdf),
    Reader("URDF of the Panda", "a.urdf", lambda: [PANDA.urdf.read_bytes()], read_urdf),
    Reader(
        "controller", "c", lambda: [_controller().encode()], text_reader(lambda t: parse_controller(t, "it"))
    ),
    Reader(
        "tool",
        "t",
        lambda: [b'{"mass": 1, "center_of_mass": [0, 0, 0.1], "inertia": [1, 0, 0, 1, 0, 1]}'],
        text_reader(lambda t: parse_tool(t, "it")),
    ),
    Reader("tolerances", "t.yaml", lambda: [TOLERANCE_FILE.encode()], read_tolerances),
    Reader(
        "parameters", "p.yaml", lambda: [_parameters()], lambda p: load_parameters(p, tuple(all_settings()))
    ),
    Reader("trajectory", "next.yaml", lambda: [TRAJECTORY], TrajectoryFile.read),
    Reader("library", "l.yaml", lambda: [b"families: [payload, backlash]\n", b"[payload]"], read_library),
    Reader("recordings.json", "recordings.json", lambda: [b'{"fit": ["a.mcap"], "held_out": []}'], _roles),
    Reader("calibration", "c", lambda: [_calibration().encode()], text_reader(from_message.calibration)),
    Reader(
        "weights announced",
        "w",
        lambda: [_announcement().encode()],
        text_reader(from_message.announced_weights),
    ),
    Reader(
        "report.json",
        "report.json",
        lambda: [b'{"schema": 1, "verdict": "no_gap", "effects": []}'],
        read_report,
    ),
    *_damageable(),
    *OTHER_KINDS,
    *FILES_OF_CELLS,
    *TRACKS_OF_BODIES,
    *DEPTH_AND_FRAMES,
)
