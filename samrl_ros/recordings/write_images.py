"""Recordings of a cell's camera to bags with the contract's topics."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.observation import ArmReading
from samrl_ros.bags.qos_metadata import topic_qos
from samrl_ros.bags.writer import BagWriter
from samrl_ros.contract.topics import TOPICS
from samrl_ros.recordings.image_bag import CALIBRATION, COLOR, DEPTH, INFO, MASK, STATES

START_NS = 1_000_000_000  # stamp of a recording's time zero
FRAME = "camera"


def write_image_bag(recording: ImageRecording, path: Path) -> Path:
    """Write a recording as one `*.mcap` file; its path is returned. Needs rclpy."""
    from rclpy.serialization import serialize_message

    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".bag_") as folder:
        bag = Path(folder) / "bag"
        with BagWriter(bag) as writer:
            for at, topic, message in image_messages(recording):
                writer.add_topic(topic, TOPICS[topic].type, topic_qos(topic))
                writer.write(topic, at, serialize_message(message))
        (bag / "bag_0.mcap").rename(path)
    return path


def image_messages(recording: ImageRecording, start_ns: int = START_NS) -> list[tuple[int, str, Any]]:
    """Stamp [ns], topic and message of all that the cell's topics carry of a recording, in order of time."""
    return sorted(_messages(recording, start_ns), key=lambda m: m[0])


def _messages(recording: ImageRecording, start_ns: int) -> Iterator[tuple[int, str, Any]]:
    from samrl_ros.conversions import to_message

    def stamp(seconds: float) -> int:
        return start_ns + round(float(seconds) * 1e9)

    cell = replace(
        cell_named(recording.cell),
        camera_in_flange=recording.camera_in_flange,
        camera_base_in_world=recording.camera_base_in_world,
        tool_base_in_world=recording.tool_base_in_world,
    )
    first = min(recording.time[0], recording.camera_joint_time[0], recording.tool_joint_time[0])
    yield stamp(first), CALIBRATION, to_message.calibration(cell)
    for role, topic in STATES.items():
        arm = role.removesuffix("_arm")
        times, positions = getattr(recording, f"{arm}_joint_time"), getattr(recording, f"{arm}_joints")
        still, names = np.zeros(positions.shape[1]), cell.arm(role).joint_names
        for time, position in zip(times, positions, strict=True):
            reading = ArmReading(stamp(time), position, still, still)
            yield stamp(time), topic, to_message.joint_state(reading, names)
    for k, time in enumerate(recording.time):
        at = stamp(time)
        pictures = {
            COLOR: (recording.color, "rgb8"),
            DEPTH: (recording.depth, "32FC1"),
            MASK: (recording.mask, "mono8"),
        }
        for topic, (values, encoding) in pictures.items():
            yield at, topic, to_message.image(values[k], encoding, at, FRAME)
        yield at, INFO, to_message.camera_info(recording.intrinsics, at, FRAME)
