"""Bags of a camera: what is read is what was recorded, and what is missing is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.common.errors import InputError

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros


@pytest.mark.thorough
def test_a_bag_holds_what_was_recorded(recordings: list[ImageRecording], tmp_path: Path) -> None:
    from samrl_ros.recordings.image_bag import DEPTH, load_image_bags, read_image_bag
    from samrl_ros.recordings.write_images import image_messages, write_image_bag
    from tests.ros.bag_files import record

    recorded = recordings[0].part(np.arange(30))
    bag = write_image_bag(recorded, tmp_path / "A.mcap")
    read = read_image_bag(bag, recorded.task)
    assert (read.task, read.cell, read.intrinsics) == (recorded.task, recorded.cell, recorded.intrinsics)
    for name in ("color", "depth", "mask", "camera_joints", "tool_joints"):
        np.testing.assert_array_equal(getattr(read, name), getattr(recorded, name), err_msg=name)
    begun = recorded.camera_joint_time[0]
    np.testing.assert_allclose(read.time, recorded.time - begun, atol=2e-9)
    assert read.camera_in_flange.angle_to(recorded.camera_in_flange) < 1e-9
    fitted, held, notes = load_image_bags([bag], [], recorded.task, None)
    assert len(fitted[0].time) > len(held[0].time) >= 6 and "held out" in notes[0]
    messages = [m for m in image_messages(recorded) if m[1] != DEPTH]
    with pytest.raises(InputError, match=f"lacks {DEPTH}"):
        read_image_bag(record(tmp_path / "B", messages), recorded.task)
