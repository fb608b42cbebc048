"""`python -m samrl_ros.doctor.talk_trial`: images from one process to another, as the cell's nodes send them.

Exit code 0 and a line of what arrived; 1 and a line of what did not.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image

from samrl_core.common.child_process import ends_with_parent
from samrl_ros.contract.exit_codes import FAILED, OK
from samrl_ros.hosting.host import start_ros, stop_ros

IMAGES = 10  # to hear
PERIOD_S = 0.05
TIMEOUT_S = 20.0
SIZE = (480, 640)


def main() -> int:
    """Start a speaker as a process of its own, and hear it; `talk TOPIC` is the speaker."""
    if sys.argv[1:2] == ["talk"]:
        return _talk(sys.argv[2])
    topic = f"/samrl_doctor_{os.getpid()}/image"
    command = [sys.executable, "-m", "samrl_ros.doctor.talk_trial", "talk", topic]
    nowhere = subprocess.DEVNULL
    speaker = subprocess.Popen(command, stdout=nowhere, stderr=nowhere, preexec_fn=ends_with_parent())
    start_ros([])
    try:
        heard, took = _listen(topic)
    finally:
        speaker.terminate()
        speaker.wait()
        stop_ros()
    if heard < IMAGES:
        print(f"{heard} of {IMAGES} images of 640x480 arrived from another process in {TIMEOUT_S:.0f} s")
        return FAILED
    print(f"images of 640x480 arrive from another process, the first after {took:.1f} s")
    return OK


def _listen(topic: str) -> tuple[int, float]:
    node = rclpy.create_node(f"samrl_doctor_{os.getpid()}")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    times: list[float] = []
    whole = 3 * SIZE[0] * SIZE[1]

    def on_image(message: Image) -> None:
        if len(message.data) == whole:
            times.append(time.monotonic())

    profile = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_subscription(Image, topic, on_image, profile)
    begin = time.monotonic()
    while len(times) < IMAGES and time.monotonic() - begin < TIMEOUT_S:
        executor.spin_once(timeout_sec=0.1)
    node.destroy_node()
    return len(times), (times[0] - begin) if times else TIMEOUT_S


def _talk(topic: str) -> int:
    start_ros([])
    node = rclpy.create_node(f"samrl_doctor_talk_{os.getpid()}")
    publisher = node.create_publisher(
        Image, topic, QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    message = Image(height=SIZE[0], width=SIZE[1], encoding="rgb8", step=3 * SIZE[1])
    message.data = bytes(3 * SIZE[0] * SIZE[1])
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        publisher.publish(message)
        time.sleep(PERIOD_S)
    stop_ros()
    return OK


if __name__ == "__main__":
    sys.exit(main())
