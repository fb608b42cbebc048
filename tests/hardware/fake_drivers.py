"""Publishes what franka_ros2, flexiv_ros2 and realsense-ros publish: `python fake_drivers.py OFFSET_S`.

Joint states aim at 1 kHz with the joints in another order, images come at 15 Hz as bgr8 and 16UC1 in
millimetres. OFFSET_S is added to every stamp, as by a driver computer whose clock is off.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import rclpy
from sensor_msgs.msg import CameraInfo, Image, JointState

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_ros.conversions import to_message
from samrl_ros.hardware.driver_file import driver_named
from samrl_ros.hosting.host import start_ros

SIZE = 480
FRAME = "camera_color_optical_frame"
CAMERA_PERIOD_S = 1.0 / 15.0


def main() -> None:
    """Publish until killed."""
    offset_ns = round(1e9 * float(sys.argv[1]))
    start_ros([])
    node = rclpy.create_node("fake_drivers")
    cell, camera = cell_named(DEFAULT_CELL), driver_named("realsense_ros")
    arms = []
    for role, name in (("tool_arm", "franka_ros2"), ("camera_arm", "flexiv_ros2")):
        driver = driver_named(name)
        message = JointState(name=list(reversed(list(driver.joints or {}))))
        message.position = cell.arm(role).home[::-1].tolist()
        message.velocity = message.effort = [0.0] * len(message.name)
        topic = driver.streams["joint_states"].driver_topic
        arms.append((node.create_publisher(JointState, topic, 10), message))
    kinds = {"color": Image, "depth": Image, "info": CameraInfo}
    publishers = {
        name: node.create_publisher(kinds[name], stream.driver_topic, 10)
        for name, stream in camera.streams.items()
    }
    scale = SIZE / cell.intrinsics.width
    info = CameraInfo(width=SIZE, height=SIZE)
    info.k = [v * scale if i != 8 else 1.0 for i, v in enumerate(cell.intrinsics.ros_k)]
    color = np.zeros((SIZE, SIZE, 3), np.uint8)
    depth = np.full((SIZE, SIZE), 450, np.uint16)  # [mm]
    next_image = time.monotonic()
    while True:
        for publisher, message in arms:
            message.header = to_message.header(time.time_ns() + offset_ns)
            publisher.publish(message)
        if time.monotonic() >= next_image:
            next_image += CAMERA_PERIOD_S
            stamp = time.time_ns() + offset_ns
            publishers["color"].publish(to_message.image(color, "bgr8", stamp, FRAME))
            publishers["depth"].publish(to_message.image(depth, "16UC1", stamp, FRAME))
            info.header = to_message.header(stamp, FRAME)
            publishers["info"].publish(info)
        time.sleep(0.001)


if __name__ == "__main__":
    main()
