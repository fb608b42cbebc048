"""Bags of a camera: what is read is what was recorded, and what is missing is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.observation import ArmReading
from samrl_core.common.errors import InputError

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
START_NS = 5_000_000_000


def messages_of(recording: ImageRecording) -> list[tuple[int, str, Any]]:
    """A recording as the cell's topics carry it."""
    from samrl_ros.conversions import to_message
    from samrl_ros.recordings.image_bag import CALIBRATION, COLOR, DEPTH, INFO, MASK, STATES

    def stamp(seconds: float) -> int:
        return START_NS + round(float(seconds) * 1e9)

    cell = cell_named(DEFAULT_CELL)
    out: list[tuple[int, str, Any]] = [(START_NS, CALIBRATION, to_message.calibration(cell))]
    for role in STATES:
        arm = role.removesuffix("_arm")
        times, positions = getattr(recording, f"{arm}_joint_time"), getattr(recording, f"{arm}_joints")
        still = np.zeros(positions.shape[1])
        for time, position in zip(times, positions, strict=True):
            reading = ArmReading(stamp(time), position, still, still)
            names = cell.arm(role).joint_names
            out.append((stamp(time), STATES[role], to_message.joint_state(reading, names)))
    for k, time in enumerate(recording.time):
        at = stamp(time)
        pixels = ((COLOR, recording.color, "rgb8"), (DEPTH, recording.depth, "32FC1"),
                  (MASK, recording.mask, "mono8"))  # fmt: skip
        out += [
            (at, topic, to_message.image(values[k], encoding, at, "camera"))
            for topic, values, encoding in pixels
        ]
        out.append((at, INFO, to_message.camera_info(recording.intrinsics, at, "camera")))
    return sorted(out, key=lambda m: m[0])


@pytest.mark.thorough
def test_a_bag_holds_what_was_recorded(recordings: list[ImageRecording], tmp_path: Path) -> None:
    from samrl_ros.recordings.image_bag import DEPTH, load_image_bags, read_image_bag
    from tests.ros.bag_files import record

    recorded = recordings[0].part(np.arange(30))
    bag = record(tmp_path / "A", messages_of(recorded))
    read = read_image_bag(bag, recorded.task)
    assert (read.task, read.cell, read.intrinsics) == (recorded.task, recorded.cell, recorded.intrinsics)
    for name in ("color", "depth", "mask", "camera_joints", "tool_joints"):
        np.testing.assert_array_equal(getattr(read, name), getattr(recorded, name), err_msg=name)
    begun = recorded.camera_joint_time[0]
    np.testing.assert_allclose(read.time, recorded.time - begun, atol=2e-9)
    assert read.camera_in_flange.angle_to(recorded.camera_in_flange) < 1e-9
    fitted, held, notes = load_image_bags([bag], [], recorded.task, None)
    assert len(fitted[0].time) > len(held[0].time) >= 6 and "held out" in notes[0]
    messages = [m for m in messages_of(recorded) if m[1] != DEPTH]
    with pytest.raises(InputError, match=f"lacks {DEPTH}"):
        read_image_bag(record(tmp_path / "B", messages), recorded.task)
