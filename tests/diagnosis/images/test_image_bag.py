"""Bags of a camera: what is read is what was recorded, and what is missing is named."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

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
    with pytest.raises(InputError, match="100 % of the held-out images of copy are also in the fitted A"):
        load_image_bags([bag], [shutil.copy(bag, tmp_path / "copy.mcap")], recorded.task, None)
    messages = [m for m in image_messages(recorded) if m[1] != DEPTH]
    with pytest.raises(InputError, match=f"lacks {DEPTH}"):
        read_image_bag(record(tmp_path / "B", messages), recorded.task)


@pytest.mark.thorough
def test_what_cannot_be_compared_is_named(
    recordings: list[ImageRecording], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command, with its exit code: no mask, another size, no calibration, no object, no stamp."""
    from samrl_ros.cli.main import run
    from samrl_ros.contract.exit_codes import INPUT_REFUSED
    from samrl_ros.recordings.image_bag import CALIBRATION, COLOR, INFO, MASK
    from samrl_ros.recordings.write_images import image_messages
    from tests.ros.bag_files import record

    recorded = recordings[0].part(np.arange(30))

    def smaller(message: Any) -> Any:
        message.width = message.height = 64
        return message

    def without_stamp(message: Any) -> Any:
        message.header.stamp.sec = message.header.stamp.nanosec = 0
        return message

    def blank(message: Any) -> Any:
        message.data = bytes(len(message.data))
        return message

    spoilt: dict[str, tuple[str, Any, str]] = {
        "no_mask": (MASK, None, f"lacks {MASK}"),
        "no_calibration": (CALIBRATION, None, f"lacks {CALIBRATION}"),
        "other_size": (INFO, smaller, "128x128, camera_info says 64x64"),
        "no_stamp": (COLOR, without_stamp, "has no stamp"),
        "empty_mask": (MASK, blank, "is in 0 of"),
    }
    for name, (of, change, says) in spoilt.items():
        messages = [
            (at, topic, change(message) if topic == of else message)
            for at, topic, message in image_messages(recorded)
            if topic != of or change is not None
        ]
        bag = record(tmp_path / name, messages)
        out = tmp_path / f"{name}_out"
        assert run(["diagnose", str(bag), "--camera", "--out", str(out)]) == INPUT_REFUSED, name
        said = " ".join(capsys.readouterr().err.split())
        assert says in said, (name, said)
        assert not (out / "report.json").exists()


@pytest.mark.thorough
def test_of_a_long_bag_frames_all_along_it_are_held(
    recordings: list[ImageRecording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from samrl_ros.bags import scan
    from samrl_ros.recordings import image_bag
    from samrl_ros.recordings.write_images import write_image_bag

    recorded = recordings[0].part(np.arange(40))
    bag = write_image_bag(recorded, tmp_path / "A.mcap")
    monkeypatch.setattr(image_bag, "MOST_FRAMES", 14)
    read = image_bag.read_image_bag(bag, recorded.task)
    assert len(read.time) == 14 and len(read.camera_joints) == len(recorded.camera_joints)
    at = [int(np.argmin(np.abs(recorded.time - recorded.camera_joint_time[0] - t))) for t in read.time]
    assert (at[0], at[-1]) == (0, 39) and set(np.diff(at)) == {3}
    np.testing.assert_array_equal(read.depth, recorded.depth[at])
    np.testing.assert_array_equal(read.color, recorded.color[at])
    # A writer's headers may state another span than blocks have: nothing is missing then.
    true = scan.index_file

    def misstated(*given: Any) -> scan.FileIndex:
        index = true(*given)
        index.blocks = [replace(block, end_ns=block.start_ns) for block in index.blocks]
        return index

    monkeypatch.setattr(scan, "index_file", misstated)
    again = image_bag.read_image_bag(bag, recorded.task)
    np.testing.assert_array_equal(again.color, read.color)
    np.testing.assert_array_equal(again.mask, read.mask)
