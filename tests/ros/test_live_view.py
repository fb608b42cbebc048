"""What the live view adds for its clients."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros

IMAGE = "sensor_msgs/msg/Image"


def test_the_difference_comes_with_the_model_image_of_the_same_instant() -> None:
    from rclpy.serialization import deserialize_message, serialize_message

    from samrl_ros.cell.live_view import Difference
    from samrl_ros.cell.report.pictures import COLOR, MODEL
    from samrl_ros.contract.message_types import message_class
    from samrl_ros.conversions.from_message import image, stamp_ns
    from tests.ros.small_run import picture, stamped

    difference = Difference()
    for k in range(100):
        assert not difference.take(COLOR, IMAGE, serialize_message(stamped(picture(k), k + 1)))
    assert not difference.take(MODEL, IMAGE, serialize_message(stamped(picture(60), 7)))  # long gone
    found = difference.take(MODEL, IMAGE, serialize_message(stamped(picture(60), 91)))
    message = deserialize_message(found, message_class(IMAGE))
    assert stamp_ns(message) == 91
    assert np.array_equal(image(message), np.full((12, 16, 3), 60))  # twice |90 - 60|
