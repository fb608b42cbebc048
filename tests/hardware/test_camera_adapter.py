"""A driver's images become the cell's, whatever their size, latency and order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from sensor_msgs.msg import CameraInfo

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.types.observation import Frame
from samrl_core.common.errors import InputError
from samrl_ros.conversions import to_message
from samrl_ros.hardware.camera_adapter import CameraAdapter
from tests.hardware.fake_cell import FRAME, HEIGHT, SCALE, WIDTH, embedded

pytestmark = pytest.mark.ros
INTRINSICS = cell_named(DEFAULT_CELL).intrinsics
STAMP_NS = 1_700_000_000_000_000_000


def pictures(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour, depth [mm] and labels in the cell's size."""
    random = np.random.default_rng(seed)
    shape = (INTRINSICS.height, INTRINSICS.width)
    color = random.integers(0, 256, (*shape, 3), np.uint8)
    return color, random.integers(0, 900, shape, np.uint16), random.integers(0, 4, shape, np.uint8)


def info(stamp_ns: int = STAMP_NS) -> CameraInfo:
    made = CameraInfo(header=to_message.header(stamp_ns, FRAME), width=WIDTH, height=HEIGHT)
    fx, fy = SCALE * INTRINSICS.fx, SCALE * INTRINSICS.fy
    made.k = [fx, 0.0, WIDTH / 2 - 0.5, 0.0, fy, HEIGHT / 2 - 0.5, 0.0, 0.0, 1.0]
    made.distortion_model = "plumb_bob"
    return made


def messages(stamp_ns: int = STAMP_NS, seed: int = 0) -> dict[str, Any]:
    color, depth, mask = pictures(seed)
    return {
        "color": to_message.image(embedded(color[..., ::-1]), "bgr8", stamp_ns, FRAME),
        "depth": to_message.image(embedded(depth), "16UC1", stamp_ns + 2_000_000, FRAME),
        "mask": to_message.image(embedded(mask), "mono8", stamp_ns, FRAME),
    }


@pytest.mark.parametrize("order", ["color depth mask", "depth color mask", "mask depth color"])
def test_the_middle_of_a_larger_image_comes_through_exactly(order: str) -> None:
    adapter, said = CameraAdapter(INTRINSICS), messages()
    assert adapter.take("info", info()) is None
    frames = [adapter.take(name, said[name]) for name in order.split()]
    assert frames[:2] == [None, None]
    frame = frames[2]
    assert isinstance(frame, Frame) and frame.stamp_ns == STAMP_NS
    color, depth, mask = pictures()
    assert np.array_equal(frame.color, color) and np.array_equal(frame.mask, mask)
    metres = np.where(depth == 0, np.nan, depth.astype(np.float32) / 1000)
    assert np.array_equal(frame.depth, metres, equal_nan=True)


def test_labels_that_come_images_later_find_theirs() -> None:
    adapter = CameraAdapter(INTRINSICS)
    adapter.take("info", info())
    both = [messages(STAMP_NS + k * 66_000_000, seed=k) for k in range(3)]
    for said in both:
        assert adapter.take("color", said["color"]) is None
        assert adapter.take("depth", said["depth"]) is None
    for k, said in enumerate(both):
        frame = adapter.take("mask", said["mask"])
        assert frame is not None and np.array_equal(frame.mask, pictures(k)[2])


def test_what_does_not_belong_together_is_not_put_together() -> None:
    adapter = CameraAdapter(INTRINSICS)
    adapter.take("info", info())
    said, other = messages(), messages(STAMP_NS + 20_000_000)
    for name, message in (("color", said["color"]), ("mask", said["mask"]), ("depth", other["depth"])):
        assert adapter.take(name, message) is None


@pytest.mark.parametrize("spoil", ["size", "encoding", "distortion"])
def test_images_that_do_not_fit_are_refused(spoil: str) -> None:
    adapter, said, lens = CameraAdapter(INTRINSICS), messages(), info()
    if spoil == "size":
        said["depth"] = to_message.image(np.ones((240, 320), np.uint16), "16UC1", STAMP_NS, FRAME)
    elif spoil == "encoding":
        said["mask"] = to_message.image(np.zeros((HEIGHT, WIDTH, 3), np.uint8), "rgb8", STAMP_NS, FRAME)
    else:
        lens.d = [0.1, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(InputError, match=r"align the images|must be mono8|rectified"):
        adapter.take("info", lens)
        for name in ("color", "depth", "mask"):
            adapter.take(name, said[name])
