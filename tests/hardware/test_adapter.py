"""Driver messages become the cell's, and peg insertion runs on a cell that hears drivers alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from sensor_msgs.msg import JointState

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.common.errors import InputError
from samrl_ros.cell.local_graph import LocalGraph
from samrl_ros.contract.topics import arm_topic, camera_topic, cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.hardware import adapter
from samrl_ros.hardware.driver_file import driver_named

pytestmark = pytest.mark.ros
CELL = cell_named(DEFAULT_CELL)
DRIVERS = {"tool_arm": driver_named("franka_ros2"), "camera_arm": driver_named("flexiv_ros2")}
FRAME = "camera_color_optical_frame"
OFFSET_NS = 2_000_000  # by which the drivers' clocks are ahead [ns], within what the pre-flight allows
JOINT_HZ, CAMERA_HZ = 1000, 15


def driver_joint_state(message: Any, role: str) -> JointState:
    """As the broadcaster of the arm's driver would say it: its names, in another order."""
    names = list(DRIVERS[role].joints or {})
    order = [3, 6, 0, 5, 1, 4, 2]
    said = JointState(header=to_message.header(from_message.stamp_ns(message) + OFFSET_NS))
    said.name = [names[k] for k in order]
    for field in ("position", "velocity", "effort"):
        setattr(said, field, [getattr(message, field)[k] for k in order])
    return said


class FakeDrivers:
    """In the place of the bridge's outbox: sensors leave as drivers send them, and come in by the adapter."""

    def __init__(self, outbox: Any) -> None:
        self._outbox = outbox
        self.adapted = {"joints": 0, "color": 0, "depth": 0}
        self.heard = 0  # joint states of drivers
        self._last: dict[str, int] = {}
        self._arms = {arm_topic(role, "joint_states"): role for role in ROLES}

    def log(self, level: str, text: str) -> None:
        self._outbox.log(level, text)

    def publish(self, topic: str, message: Any) -> None:
        stamp = from_message.stamp_ns(message) + OFFSET_NS if hasattr(message, "header") else 0
        if topic in self._arms:
            role = self._arms[topic]
            said = driver_joint_state(message, role)
            self.heard += 1
            if not adapter.is_due(self._last.get(role, -(10**9)), from_message.stamp_ns(said)):
                return
            self._last[role] = from_message.stamp_ns(said)
            message = adapter.joint_state(said, DRIVERS[role].joints or {}, CELL.arm(role))
            self.adapted["joints"] += 1
        elif topic == camera_topic("color/image_raw"):
            pixels = from_message.image(message)[..., ::-1]
            message = adapter.color_image(to_message.image(pixels, "bgr8", stamp, FRAME), FRAME)
            self.adapted["color"] += 1
        elif topic == camera_topic("depth/image_rect_raw"):
            metres = from_message.image(message)
            millimetres = np.where(np.isfinite(metres), np.round(1e3 * metres), 0).astype(np.uint16)
            message = adapter.depth_image(to_message.image(millimetres, "16UC1", stamp, FRAME), FRAME)
            self.adapted["depth"] += 1
        elif topic in (camera_topic("mask/image_raw"), camera_topic("color/camera_info")):
            message.header = to_message.header(stamp, FRAME)
        self._outbox.publish(topic, message)


def test_joints_come_back_in_our_order_under_our_names() -> None:
    spec = CELL.tool_arm
    ours = to_message.header(1)
    message = JointState(header=ours, name=list(spec.joint_names), position=[float(k) for k in range(7)])
    message.velocity = message.effort = [0.5] * 7
    made = adapter.joint_state(
        driver_joint_state(message, "tool_arm"), DRIVERS["tool_arm"].joints or {}, spec
    )
    assert list(made.name) == list(spec.joint_names) and list(made.position) == list(message.position)


def test_a_grippers_joints_beside_the_arms_are_left_out() -> None:
    spec, joints = CELL.tool_arm, DRIVERS["tool_arm"].joints or {}
    message = JointState(name=["panda_finger_joint1", *joints])
    message.position = [0.04, *(float(k) for k in range(7))]
    message.velocity, message.effort = [0.0] * 8, [float("nan"), *[0.5] * 7]
    made = adapter.joint_state(message, joints, spec)
    assert list(made.name) == list(spec.joint_names) and list(made.position) == [float(k) for k in range(7)]
    message.name = ["panda_joint1", *joints]  # which of the two is it?
    with pytest.raises(InputError, match="driver's file"):
        adapter.joint_state(message, joints, spec)


@pytest.mark.parametrize("spoil", ["name", "effort", "nan"])
def test_joint_states_that_do_not_fit_are_refused(spoil: str) -> None:
    joints = DRIVERS["camera_arm"].joints or {}
    message = JointState(name=list(joints), position=[0.0] * 7, velocity=[0.0] * 7, effort=[0.0] * 7)
    if spoil == "name":
        message.name = ["x", *list(joints)[1:]]
    elif spoil == "effort":
        message.effort = []
    else:
        message.position = [float("nan")] * 7
    with pytest.raises(InputError, match="driver"):
        adapter.joint_state(message, joints, CELL.camera_arm)


def test_other_encodings_are_refused() -> None:
    image = to_message.image(np.zeros((4, 4), np.uint8), "mono8", 1, FRAME)
    for convert in (adapter.color_image, adapter.depth_image):
        with pytest.raises(InputError, match="set the driver's format"):
            convert(image, FRAME)


def test_colours_and_metres_are_right() -> None:
    blue = np.zeros((2, 2, 3), np.uint8)
    blue[..., 0] = 255  # of bgr8
    made = from_message.image(adapter.color_image(to_message.image(blue, "bgr8", 1, FRAME), FRAME))
    assert (made == [0, 0, 255]).all()
    depth = np.array([[0, 450]], np.uint16)
    metres = from_message.image(adapter.depth_image(to_message.image(depth, "16UC1", 1, FRAME), FRAME))
    assert np.isnan(metres[0, 0]) and metres[0, 1] == np.float32(0.45)


def test_a_kilohertz_becomes_250_hz() -> None:
    passed, last = [], -(10**9)
    for k in range(100):
        stamp = 1_000_000 * k + (-1) ** k * 100_000  # with jitter
        if adapter.is_due(last, stamp):
            passed.append(k)
            last = stamp
    assert passed == list(range(0, 100, 4))
    assert adapter.is_due(10**9, 0)  # a clock that was set back is for others to judge


@pytest.mark.slow
def test_peg_insertion_runs_on_what_drivers_say() -> None:
    outcomes: list[Any] = []

    def listen(topic: str, message: Any) -> None:
        if topic == cell_topic("supervisor/outcome"):
            outcomes.append(message)

    graph = LocalGraph("peg_insertion", listener=listen)
    fake = FakeDrivers(graph.bridge._outbox)
    graph.bridge._outbox = fake  # ty: ignore[invalid-assignment]
    graph.bridge._every |= {"joints": 1000 // JOINT_HZ, "camera": round(1000 / CAMERA_HZ)}
    try:
        graph.run()
    finally:
        graph.close()
    assert min(fake.adapted.values()) > 10, fake.adapted
    assert fake.heard > 3.5 * fake.adapted["joints"]  # 1 kHz became 250 Hz
    assert outcomes and outcomes[0].detected_success, (outcomes, graph.logs[-5:])
