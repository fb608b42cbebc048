"""Each conversion there and back, and each refusal."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros

from samrl_core.cell.types.camera import Intrinsics  # noqa: E402
from samrl_core.cell.types.observation import ArmCommand, ArmReading  # noqa: E402
from samrl_core.cell.types.pose import Pose  # noqa: E402
from samrl_core.common.errors import InputError  # noqa: E402
from samrl_ros.conversions import from_message, to_message  # noqa: E402

NAMES = tuple(f"joint{i}" for i in range(7))
STAMP = 12_345_678_901


def reading() -> ArmReading:
    values = np.arange(7, dtype=float)
    return ArmReading(STAMP, 0.1 * values, 0.2 * values, 3.0 * values)


def test_joint_state_there_and_back_in_any_order() -> None:
    message = to_message.joint_state(reading(), NAMES)
    for field in ("name", "position", "velocity", "effort"):
        setattr(message, field, list(getattr(message, field))[::-1])
    back = from_message.arm_reading(message, NAMES)
    assert back.stamp_ns == STAMP
    np.testing.assert_array_equal(back.position, reading().position)
    np.testing.assert_array_equal(back.effort, reading().effort)


@pytest.mark.parametrize("name", ["jointX", "joint1"])
def test_wrong_or_double_joint_names_are_refused(name: str) -> None:
    message = to_message.joint_state(reading(), NAMES)
    names = list(message.name)
    names[0] = name
    message.name = names
    with pytest.raises(InputError, match="joint names"):
        from_message.arm_reading(message, NAMES)


def test_a_reading_that_is_not_finite_names_the_joint() -> None:
    message = to_message.joint_state(reading(), NAMES)
    message.velocity[3] = float("nan")
    with pytest.raises(InputError, match="velocity of joint3"):
        from_message.arm_reading(message, NAMES)


def test_command_there_and_back() -> None:
    values = np.linspace(-1, 1, 7)
    message = to_message.command(ArmCommand(STAMP, values, 2 * values, 3 * values, 4 * values), NAMES)
    back = from_message.arm_command(message, NAMES)
    np.testing.assert_array_equal(back.effort, 4 * values)
    message.points = []
    with pytest.raises(InputError, match="0 points"):
        from_message.arm_command(message, NAMES)


@pytest.mark.parametrize(
    ("encoding", "dtype", "shape"),
    [
        ("rgb8", np.uint8, (6, 5, 3)),
        ("mono8", np.uint8, (6, 5)),
        ("32FC1", np.float32, (6, 5)),
    ],
)
def test_images_there_and_back(encoding: str, dtype: type, shape: tuple[int, ...]) -> None:
    pixels = (np.random.default_rng(0).random(shape) * 200).astype(dtype)
    message = to_message.image(pixels, encoding, STAMP, "camera")
    np.testing.assert_array_equal(from_message.image(message), pixels)
    assert from_message.stamp_ns(message) == STAMP


def test_depth_in_millimetres_becomes_metres_with_nan() -> None:
    message = to_message.image(np.array([[0, 1500]], dtype=np.uint16), "16UC1", STAMP, "camera")
    depth = from_message.image(message)
    assert np.isnan(depth[0, 0])
    assert depth[0, 1] == pytest.approx(1.5)


def test_empty_short_and_unknown_images_are_refused() -> None:
    message = to_message.image(np.zeros((4, 4), np.uint8), "mono8", STAMP, "camera")
    message.data = message.data[:-1]
    with pytest.raises(InputError, match="15 bytes"):
        from_message.image(message)
    message.encoding = "bayer_rggb8"
    with pytest.raises(InputError, match="bayer_rggb8"):
        from_message.image(message)
    empty = to_message.image(np.zeros((0, 4), np.uint8), "mono8", STAMP, "camera")
    with pytest.raises(InputError, match="empty"):
        from_message.image(empty)


def test_camera_info_there_and_back() -> None:
    k = Intrinsics.from_fov(128, 96, 0.7)
    assert from_message.intrinsics(to_message.camera_info(k, STAMP, "camera")) == k


def not_a_number(message):
    message.d = [float("nan")]


def a_fisheye(message):
    message.distortion_model, message.d = "equidistant", [0.0] * 4


def binned(message):
    message.binning_x = 2


def cut_out(message):
    message.roi.y_offset = 3


def skewed(message):
    message.k[1] = 0.5


def uncalibrated(message):
    message.k = [0.0] * 9


def without_a_middle(message):
    message.k[2] = float("nan")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (not_a_number, "distortion"),
        (a_fisheye, "equidistant"),
        (binned, "binning 2x0"),
        (cut_out, "region of interest at .0, 3."),
        (skewed, "skewed"),
        (uncalibrated, "no camera matrix"),
        (without_a_middle, "principal point"),
    ],
)
def test_what_no_pinhole_takes_is_refused(change, why: str) -> None:
    message = to_message.camera_info(Intrinsics.from_fov(8, 8, 0.7), STAMP, "camera")
    from_message.intrinsics(message)
    change(message)
    with pytest.raises(InputError, match=why):
        from_message.intrinsics(message)


def test_distorted_images_are_refused() -> None:
    message = to_message.camera_info(Intrinsics.from_fov(8, 8, 0.7), STAMP, "camera")
    message.d = [0.1, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(InputError, match="distortion"):
        from_message.intrinsics(message)


def test_pose_there_and_back() -> None:
    pose = Pose.from_rpy(np.array([0.1, -0.2, 0.3]), (0.4, -0.5, 0.6))
    back = from_message.pose(to_message.pose(pose))
    np.testing.assert_allclose(back.matrix(), pose.matrix(), atol=1e-12)


def test_a_broken_calibration_is_refused() -> None:
    for text in ("{", "{}", '{"camera_in_flange": 1}'):
        with pytest.raises(InputError, match="calibration"):
            from_message.calibration(text)


@pytest.mark.parametrize(
    "text",
    ["", "3", "[]", "{}", '{"asks": "money", "episode": 1, "text": ""}', '{"asks": "scene", "episode": "1"}'],
)
def test_requests_of_another_node_to_the_operator_are_refused(text: str) -> None:
    asked = from_message.operator_question('{"asks": "scene", "episode": 2, "text": "lay it", "start": {}}')
    assert (asked.asks, asked.episode, asked.text) == ("scene", 2, "lay it")
    with pytest.raises(InputError, match="operator"):
        from_message.operator_question(text)


@pytest.mark.parametrize("text", ["", "3", "{}", '{"episode": true, "success": true}', '{"episode": 1}'])
def test_judgements_of_another_node_are_refused(text: str) -> None:
    assert from_message.operator_judgement('{"episode": 2, "success": false}') == (2, False)
    with pytest.raises(InputError, match="operator"):
        from_message.operator_judgement(text)
