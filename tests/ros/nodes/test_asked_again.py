"""An action that is asked for again is done once; a supervisor that starts anew asks for another one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_ros.contract.topics import arm_topic, cell_topic

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
ACTION, EXECUTED = cell_topic("policy/nominal_action"), cell_topic("manipulator/executed_action")
COMMAND, JOINTS = arm_topic("tool_arm", "command"), arm_topic("tool_arm", "joint_states")
PERIOD_NS, LONGEST = 4_000_000, 2_000  # [ns], periods of an action


class Rig:
    """A manipulator and a tool arm that is where it is told to be."""

    def __init__(self) -> None:
        from samrl_ros.nodes.manipulator import Manipulator, ManipulatorSettings

        self.now_ns = 1_000_000_000
        self.sent: list[tuple[str, Any]] = []
        self.logs: list[str] = []
        self.node = Manipulator(ManipulatorSettings(task="peg_insertion"), self)
        cell = cell_named()
        self.names = cell.arm("tool_arm").joint_names
        self.position = np.array(task_named("peg_insertion").start_joints(cell)["tool_arm"])
        self.node.start()
        self.tick()

    def publish(self, topic: str, message: Any) -> None:
        if topic == COMMAND:
            self.position = np.array(message.points[-1].positions)
        self.sent.append((topic, message))

    def log(self, level: str, text: str) -> None:
        self.logs.append(text)

    def call(self, service: str, request: Any, on_response: Any) -> None:
        raise AssertionError(service)

    def tick(self) -> None:
        from sensor_msgs.msg import JointState

        self.now_ns += PERIOD_NS
        message = JointState(name=list(self.names), position=self.position.tolist())
        message.velocity = message.effort = [0.0] * len(self.names)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self.now_ns, 10**9)
        self.node.handle(JOINTS, message)

    def ask(self, stamp_ns: int) -> None:
        from samrl_msgs.msg import ToolAction

        action = ToolAction(episode=0, step=0)
        action.header.stamp.sec, action.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        action.nominal.y = 0.005
        self.node.handle(ACTION, action)

    def done(self) -> int:
        return sum(topic == EXECUTED for topic, _ in self.sent)

    def finish(self) -> None:
        before = self.done()
        for _ in range(LONGEST):
            self.tick()
            if self.done() > before:
                return
        raise AssertionError("the action did not end")


def test_a_supervisor_started_anew_is_not_taken_for_one_that_repeats_itself() -> None:
    rig = Rig()
    seen_ns = rig.now_ns
    rig.ask(seen_ns)
    rig.tick()
    rig.ask(rig.now_ns)  # under way: once, whoever asks
    rig.finish()
    rig.ask(seen_ns)  # the same answer once more
    assert [text for text in rig.logs if "asked for twice" in text] == rig.logs and len(rig.logs) == 2
    rig.ask(rig.now_ns)  # of what was seen after it: another action, although counted as the same
    rig.finish()
    assert rig.done() == 2 and len(rig.logs) == 2
