"""Over DDS: a second publisher on an arm's command topic stops the arm, and is named."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.observation import ArmCommand
from tests.waiting import wait_for

pytest.importorskip("rclpy")
pytestmark = [pytest.mark.ros, pytest.mark.live]
COMMAND, CLOCK, SAFETY = "/cell/tool_arm/command", "/clock", "/cell/safety_state"
STATES = "/cell/tool_arm/joint_states"


class Commander:
    """A node that commands the tool arm: where it is, or smoothly away from there."""

    def __init__(self, name: str) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from samrl_ros.contract.message_types import message_class
        from samrl_ros.contract.qos import qos_named
        from samrl_ros.contract.topics import TOPICS

        self.node = rclpy.create_node(name)
        self.names = cell_named().tool_arm.joint_names
        self.now_ns, self.position, self.safety = 0, np.zeros(0), ""

        def subscribe(topic: str, callback: Any) -> None:
            listed = TOPICS[topic]
            self.node.create_subscription(message_class(listed.type), topic, callback, qos_named(listed.qos))

        subscribe(CLOCK, self._take_clock)
        subscribe(STATES, self._take_states)
        subscribe(SAFETY, self._take_safety)
        listed = TOPICS[COMMAND]
        self.publisher = self.node.create_publisher(
            message_class(listed.type), COMMAND, qos_named(listed.qos)
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def _take_clock(self, message: Any) -> None:
        self.now_ns = message.clock.sec * 1_000_000_000 + message.clock.nanosec

    def _take_states(self, message: Any) -> None:
        self.position = np.array(message.position)

    def _take_safety(self, message: Any) -> None:
        self.safety = f"{message.message} {[v.value for v in message.values]}"

    def spin(self) -> None:
        self._executor.spin_once(timeout_sec=0.005)

    def hold(self, ahead_ns: int) -> None:
        """Command the arm to stay where it is."""
        from samrl_ros.conversions import to_message

        zeros = np.zeros((3, len(self.names)))
        self.publisher.publish(
            to_message.command(ArmCommand(self.now_ns + ahead_ns, self.position, *zeros), self.names)
        )

    def close(self) -> None:
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self._executor.shutdown()


@pytest.fixture
def bridge() -> Iterator[Any]:
    from rclpy.parameter import Parameter

    from samrl_ros.hosting import NodeThread, start_ros, stop_ros
    from samrl_ros.nodes.bridge.sim_bridge import SimBridge

    start_ros([])
    # A command may take long on a busy machine: the timeout is not what this is about.
    parameters = [Parameter("world", value="mock"), Parameter("command_timeout", value=5.0)]
    thread = NodeThread(SimBridge(parameter_overrides=parameters))
    thread.start()
    yield thread.node
    thread.stop()
    stop_ros()


def test_a_second_publisher_stops_the_arm_and_is_named(bridge: Any) -> None:
    ours = Commander("rightful")

    def ready() -> bool:
        ours.spin()
        return bool(ours.now_ns and len(ours.position) and ours.publisher.get_subscription_count())

    wait_for(ready, "the bridge", 0.0)

    def tracked() -> bool:
        ours.spin()
        ours.hold(40_000_000)
        return "TRACKING" in ours.safety

    wait_for(tracked, "the arm to track its commander", 0.0)
    stranger = Commander("stranger")
    try:

        def noticed() -> bool:
            for commander in (ours, stranger):
                commander.spin()
            ours.hold(40_000_000)
            if len(stranger.position) and stranger.now_ns:
                stranger.hold(140_000_000)
            return "FAULT" in ours.safety

        wait_for(noticed, "the alarm", 0.0)
        assert "2 publishers" in ours.safety and "'stranger'" in ours.safety and "'rightful'" in ours.safety
    finally:
        stranger.close()
        ours.close()


def test_no_episode_begins_while_two_command_an_arm(bridge: Any) -> None:
    from samrl_msgs.srv import StartEpisode

    def start() -> Any:
        return bridge._on_start(StartEpisode.Request(episode=0, seed=0), StartEpisode.Response())

    def publishers() -> int:
        return len(bridge.get_publishers_info_by_topic(COMMAND))

    wait_for(lambda: start().success, "the first episode", 0.0)
    commanders = [Commander("rightful"), Commander("stranger")]
    try:
        wait_for(lambda: publishers() == 2, "both to be found", 0.0)
        answers: list[Any] = []

        def refused() -> bool:
            answers.append(start())
            return not answers[-1].success

        wait_for(refused, "the refusal", 0.0)
        assert "'rightful'" in answers[-1].message and "'stranger'" in answers[-1].message
    finally:
        commanders.pop().close()
        try:
            wait_for(lambda: start().success, "the stranger to be gone", 0.0)
        finally:
            commanders.pop().close()
