"""`python -m tests.faults.foreign KIND SECONDS`: somebody who has no business in the cell's ROS domain."""

from __future__ import annotations

import contextlib
import math
import os
import random
import socket
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.observation import ArmCommand, ArmReading
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import TOPICS, arm_topic, camera_topic, cell_topic
from samrl_ros.conversions import to_message
from samrl_ros.hosting.host import start_ros
from tests.faults.processes import DOES

COMMAND, JOINTS = arm_topic("tool_arm", "command"), arm_topic("tool_arm", "joint_states")
SAFETY, ACTION = cell_topic("safety_state"), cell_topic("policy/nominal_action")
OUTCOME, TRAJECTORY = cell_topic("supervisor/outcome"), arm_topic("tool_arm", "joint_trajectory")
IMAGE, PHASE = camera_topic("color/image_raw"), cell_topic("phase")
PERIOD_S = 0.004


class Stranger:
    """Hears the clock and the tool arm, and speaks as it likes."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("stranger")
        self.names = cell_named().tool_arm.joint_names
        self.now_ns, self.position = 0, np.zeros(0)
        self._publishers: dict[str, Any] = {}
        listed = TOPICS[JOINTS]
        self.node.create_subscription(message_class(listed.type), JOINTS, self._take, qos_named(listed.qos))
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def _take(self, message: Any) -> None:
        self.now_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        self.position = np.array(message.position)

    def spin(self) -> None:
        """Hear."""
        self._executor.spin_once(timeout_sec=0.001)

    def say(self, topic: str, message: Any) -> None:
        """Speak on a topic of the cell."""
        if topic not in self._publishers:
            listed = TOPICS[topic]
            kind, qos = message_class(listed.type), qos_named(listed.qos)
            self._publishers[topic] = self.node.create_publisher(kind, topic, qos)
        self._publishers[topic].publish(message)

    def new(self, topic: str, **values: Any) -> Any:
        """A message of a topic."""
        return message_class(TOPICS[topic].type)(**values)


def _command(stranger: Stranger, t: float) -> None:
    """Smoothly away from where the arm is, stamped far ahead: what once took the arm."""
    home = stranger.__dict__.setdefault("home", stranger.position.copy())
    shape = np.zeros((4, len(home)))
    shape[0, 0] = 0.4 * (1 - math.cos(t)) / 2
    shape[1, 0], shape[2, 0] = 0.2 * math.sin(t), 0.2 * math.cos(t)
    command = ArmCommand(stranger.now_ns + 140_000_000, home + shape[0], *shape[1:])
    stranger.say(COMMAND, to_message.command(command, stranger.names))


def _nan_command(stranger: Stranger, t: float) -> None:
    """No numbers at all."""
    bad = np.full((4, len(stranger.position)), np.nan)
    stranger.say(COMMAND, to_message.command(ArmCommand(stranger.now_ns + 40_000_000, *bad), stranger.names))


def _joint_states(stranger: Stranger, t: float) -> None:
    """A second driver that says the arm is elsewhere."""
    home = stranger.__dict__.setdefault("home", stranger.position.copy())  # the stranger hears itself as well
    reading = ArmReading(stranger.now_ns + 1_000_000, home - 0.1, home * 0.0, home * 0.0)
    stranger.say(JOINTS, to_message.joint_state(reading, stranger.names))


def _safety_alarm(stranger: Stranger, t: float) -> None:
    """An alarm that is none."""
    stranger.say(SAFETY, to_message.diagnostic("cell: command guard", 2, "the stranger cries", {}))


def _safety_ok(stranger: Stranger, t: float) -> None:
    """All is well, whatever the guard says."""
    stranger.say(SAFETY, to_message.diagnostic("cell: command guard", 0, "ok", {}))


def _action(stranger: Stranger, t: float) -> None:
    """An action that the policy never chose, longer than any may be."""
    action = stranger.new(ACTION)
    action.nominal.z = -0.5
    stranger.say(ACTION, action)


def _trajectory(stranger: Stranger, t: float) -> None:
    """A trajectory to far beyond the joints' limits."""
    point = message_class("trajectory_msgs/msg/JointTrajectoryPoint")(positions=[9.0] * len(stranger.names))
    point.time_from_start.sec = 1
    stranger.say(TRAJECTORY, stranger.new(TRAJECTORY, joint_names=list(stranger.names), points=[point]))


def _outcome(stranger: Stranger, t: float) -> None:
    """An end of the episode that the supervisor did not say."""
    stranger.say(OUTCOME, stranger.new(OUTCOME, episode=0, reason="the stranger's", detected_success=True))


def _image(stranger: Stranger, t: float) -> None:
    """A black picture of the right size."""
    image = stranger.new(IMAGE, height=480, width=640, encoding="rgb8", step=1920, data=bytes(640 * 480 * 3))
    image.header = to_message.header(stranger.now_ns, "camera_color_optical_frame")
    stranger.say(IMAGE, image)
    time.sleep(0.1)


def _clock(seconds: float) -> Callable[[Stranger, float], None]:
    def speak(stranger: Stranger, t: float) -> None:
        """Another time."""
        stranger.say("/clock", stranger.new("/clock", clock=to_message.time(int((seconds + t) * 1e9))))

    return speak


def _flood(stranger: Stranger, t: float) -> None:
    """As many messages as there is time for, long ones."""
    for _ in range(20):
        stranger.say(PHASE, stranger.new(PHASE, data="flood " + "x" * 2000))


def _garbage(stranger: Stranger, t: float) -> None:
    """Datagrams that are no RTPS, or half of it, to the ports of discovery and of the first participants."""
    domain, chance = int(os.environ.get("ROS_DOMAIN_ID", "0")), random.Random(int(t * 1e6))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for port in (7400 + 250 * domain + offset for offset in (0, 1, *range(10, 24))):
            head = chance.choice((b"RTPS\x02\x03\x01\x0f", b"RTPS", b""))
            with contextlib.suppress(ConnectionRefusedError):
                sender.sendto(head + chance.randbytes(chance.randrange(1, 1400)), ("127.0.0.1", port))


def _participants(stranger: Stranger, t: float) -> None:
    """Participants that come and go."""
    from rclpy.context import Context

    context = Context()
    context.init()
    others = [rclpy.create_node(f"visitor_{i}", context=context) for i in range(3)]
    for other in others:
        other.create_publisher(message_class(TOPICS[PHASE].type), "/visitor", 10)
        other.destroy_node()
    context.try_shutdown()


KINDS: dict[str, Callable[[Stranger, float], None]] = {
    "command": _command,
    "nan_command": _nan_command,
    "joint_states": _joint_states,
    "safety_alarm": _safety_alarm,
    "safety_ok": _safety_ok,
    "action": _action,
    "trajectory": _trajectory,
    "outcome": _outcome,
    "image": _image,
    "clock_forward": _clock(100_000.0),
    "clock_back": _clock(0.0),
    "flood": _flood,
    "garbage": _garbage,
    "participants": _participants,
}


def main() -> int:
    """Say `ready` once the arm is heard, wait for a line on standard input, then do harm for so long."""
    kind, seconds = sys.argv[1], float(sys.argv[2])
    start_ros([])
    stranger = Stranger()
    while not len(stranger.position):
        stranger.spin()
    print("ready", flush=True)
    sys.stdin.readline()
    print(DOES, flush=True)
    began = time.monotonic()
    while time.monotonic() < began + seconds:
        stranger.spin()
        KINDS[kind](stranger, time.monotonic() - began)
        time.sleep(PERIOD_S)
    return 0


if __name__ == "__main__":
    sys.exit(main())
