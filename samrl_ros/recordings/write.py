"""Arm recordings to a bag with the contract's topics, without ROS."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.common.errors import InputError
from samrl_ros.bags.qos_metadata import PROFILES
from samrl_ros.bags.writer import BagWriter
from samrl_ros.contract import topics
from samrl_ros.recordings.joint_messages import (
    JOINT_STATE,
    JOINT_TRAJECTORY,
    QUANTITIES,
    encode_text,
    encode_topic,
)
from samrl_ros.recordings.nominal_texts import controller_text, tool_text

STRING = "std_msgs/msg/String"
_LATCHED = PROFILES[topics.LATCHED]
_STATE = PROFILES[topics.STATE]

_Message = tuple[int, str, bytes]  # stamp [ns], topic, CDR


def write_recording(
    recording: ArmRecording | Sequence[ArmRecording],
    path: Path | str,
    start_s: float = 1.0,
    compression: str = "zstd",
    custom_data: dict[str, str] | None = None,
) -> Path:
    """Write one arm, or both at once, into a bag; its path is returned.

    Args:
        recording: one, or one per role; their times count from one instant.
        path: `*.mcap` for a single file, anything else for a bag folder with metadata.yaml.
        start_s: stamp [s] that a recording's time zero gets; commands may be valid before it.
        compression: zstd, lz4 or none.
        custom_data: what may be known about the run; never ground truth.

    Raises:
        InputError: the path exists, two recordings of one role, or a value before stamp zero.
    """
    many = (recording,) if isinstance(recording, ArmRecording) else tuple(recording)
    path = Path(path)
    roles = [each.arm.role for each in many]
    if not many or len(set(roles)) != len(roles):
        raise InputError(f"a bag takes one recording per role, not {roles}; write one bag each")
    if path.exists():
        raise InputError(f"{path} exists already; choose another name or move it away")
    if path.suffix != ".mcap":
        _write(many, path, start_s, compression, custom_data)
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".bag_") as folder:
        bag = Path(folder) / path.stem
        _write(many, bag, start_s, compression, custom_data)
        (bag / f"{bag.name}_0.mcap").rename(path)  # only a complete file ever has the name
    return path


def _write(
    many: tuple[ArmRecording, ...],
    folder: Path,
    start_s: float,
    compression: str,
    custom_data: dict[str, str] | None,
) -> None:
    timed: list[_Message] = []
    with BagWriter(folder, compression, 1 << 20, custom_data=custom_data) as writer:
        for recording in many:
            for topic, text in _texts(recording):
                writer.add_topic(topic, STRING, _LATCHED)
                writer.write(topic, _stamps(np.zeros(1), start_s)[0].item(), encode_text(text))
            for topic, kind, signal in _channels(recording):
                writer.add_topic(topic, kind, _STATE)
                timed.extend(_messages(topic, kind, recording.arm.joints, signal, start_s))
        marks = sorted({mark for recording in many for mark in recording.phases})
        if marks:
            writer.add_topic("/cell/phase", STRING, _STATE)
        for time_s, mark in marks:
            stamp = _stamps(np.array([time_s]), start_s)[0].item()
            timed.append((stamp, "/cell/phase", encode_text(mark)))
        timed.sort(key=lambda message: message[:2])
        for stamp, topic, data in timed:
            writer.write(topic, stamp, data)


def _texts(recording: ArmRecording) -> Iterator[tuple[str, str]]:
    arm = recording.arm
    base = f"{topics.NAMESPACE}/{arm.role}"
    if arm.urdf is not None:
        yield f"{base}/robot_description", arm.urdf
    if arm.controller is not None or arm.tolerances != Tolerances():
        yield f"{base}/controller", controller_text(arm)
    if arm.tool is not None:
        yield f"{base}/tool", tool_text(arm.tool)


def _channels(recording: ArmRecording) -> Iterator[tuple[str, str, JointSignal]]:
    base = f"{topics.NAMESPACE}/{recording.arm.role}"
    yield f"{base}/joint_states", JOINT_STATE, recording.states
    if recording.command is not None:
        yield f"{base}/command", JOINT_TRAJECTORY, recording.command
    if recording.commanded_effort is not None:
        yield f"{base}/commanded_effort", JOINT_STATE, recording.commanded_effort
    if recording.torque_enabled is not None:
        yield f"{base}/torque_enabled", JOINT_STATE, recording.torque_enabled


def _messages(
    topic: str, kind: str, joints: tuple[str, ...], signal: JointSignal, start_s: float
) -> Iterator[_Message]:
    stamps = _stamps(signal.time, start_s)
    values = {quantity: getattr(signal, quantity) for quantity in QUANTITIES[kind]}
    for quantity, array in values.items():
        if array is not None and array.shape != (len(stamps), len(joints)):
            raise InputError(
                f"{topic}: {quantity} has shape {array.shape}, must be {(len(stamps), len(joints))}"
            )
    for stamp, data in zip(stamps.tolist(), encode_topic(kind, stamps, joints, values), strict=True):
        yield stamp, topic, data


def _stamps(time_s: np.ndarray, start_s: float) -> np.ndarray:
    stamps = np.rint((np.asarray(time_s, dtype=float) + start_s) * 1e9).astype(np.int64)
    if len(stamps) and stamps.min() < 0:
        raise InputError(f"a message lies {-stamps.min() * 1e-9:.3f} s before stamp zero; raise start_s")
    return stamps
