"""What the supervisor does while nodes are away, and about motions that were given up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.model.model import Model
from samrl_core.model.real2sim.real2sim import initial_estimate

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros
TASK, CELL = task_named("peg_insertion"), cell_named()
SECOND = 1_000_000_000


class Rig:
    """A supervisor of two episodes whose first has begun, with joint states as its clock."""

    def __init__(self, estimate: Any) -> None:
        from samrl_ros.nodes.supervisor import Supervisor, SupervisorSettings

        self.asked: list[str] = []
        self.ends: list[str] = []
        self.started: list[int] = []
        self.refusal = ""  # of the cell, when an episode shall start
        self.estimate, self.now_ns, self.asked_ns, self.step = estimate, SECOND, 0, 0
        settings = SupervisorSettings(episodes=2, stop_on_model_success=False, view_period=1000)
        self.supervisor = Supervisor(settings, self)
        self.supervisor.start()
        self.ready(0)

    def publish(self, topic: str, message: Any) -> None:
        from samrl_ros.conversions import from_message
        from samrl_ros.nodes.supervisor import OUTCOME, REQUEST

        if topic == REQUEST:
            self.asked.append(message.stage)
            self.asked_ns = from_message.stamp_ns(message)
        elif topic == OUTCOME:
            self.ends.append(message.reason)

    def log(self, level: str, text: str) -> None:
        pass

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        self.started.append(request.episode)
        on_response(type("Response", (), {"success": not self.refusal, "message": self.refusal})())

    def ready(self, episode: int) -> None:
        from samrl_msgs.msg import EpisodeReady

        from samrl_ros.conversions import to_message
        from samrl_ros.nodes.supervisor import READY

        header = to_message.header(self.now_ns)
        self.supervisor.handle(READY, EpisodeReady(header=header, episode=episode, task=TASK.name))

    def pass_time(self, seconds: float) -> None:
        from samrl_core.cell.types.observation import ArmReading
        from samrl_ros.conversions import to_message
        from samrl_ros.nodes.supervisor import TOOL_JOINTS

        position, zeros = TASK.start_joints(CELL)["tool_arm"], np.zeros(7)
        for _ in range(round(seconds / 0.1)):
            self.now_ns += SECOND // 10
            reading = ArmReading(self.now_ns, position, zeros, zeros)
            self.supervisor.handle(TOOL_JOINTS, to_message.joint_state(reading, CELL.tool_arm.joint_names))

    def answer_update(self, episode: int = 0) -> None:
        from samrl_ros.conversions import model_state
        from samrl_ros.nodes.supervisor import STATE

        stamp = self.asked_ns + SECOND // 10
        found = replace(self.estimate, stamp_ns=stamp, why_stopped="converged", loss_after=0.05)
        self.supervisor.handle(STATE, model_state.to_message(found, TASK, episode, self.step))

    def answer_view(self) -> None:
        from samrl_msgs.msg import ViewTarget

        from samrl_ros.nodes.supervisor import TARGET

        self.supervisor.handle(TARGET, ViewTarget(episode=0, step=self.step, move=False))

    def tell(self, node: str, level: int, text: str = "killed by SIGKILL") -> None:
        from samrl_ros.conversions import to_message
        from samrl_ros.nodes.supervisor import WATCH

        self.supervisor.handle(WATCH, to_message.diagnostic(node, level, text, {}))

    def give_up_motion(self) -> None:
        from samrl_msgs.msg import MotionStatus

        from samrl_ros.contract.topics import arm_topic

        status = MotionStatus(arm="tool_arm", episode=0, step=self.step, status=MotionStatus.STOPPED)
        status.message = "joint states paused: motion given up"
        self.supervisor.handle(arm_topic("tool_arm", "motion_status"), status)


@pytest.fixture(scope="module")
def estimate() -> Any:
    return initial_estimate(Model(TASK, CELL))


@pytest.fixture
def acting(estimate: Any) -> Rig:
    """It waits for the action."""
    rig = Rig(estimate)
    rig.answer_update()
    rig.answer_view()
    assert rig.asked == ["update", "view", "act"]
    return rig


def test_nobody_is_pressed_while_a_node_is_away(acting: Rig) -> None:
    acting.tell("policy", 2)
    acting.pass_time(100.0)
    assert not acting.ends and acting.asked == ["update", "view", "act"]
    acting.tell("policy", 0, "back")
    assert acting.asked[3:] == ["act"]
    acting.pass_time(4.0)
    assert acting.asked[3:] == ["act", "act"]  # it may not have heard the first
    acting.pass_time(30.0)
    assert acting.ends == ["error: no answer to 'act' within 30 s"]


def test_an_action_is_asked_for_once_where_nobody_was_away(acting: Rig) -> None:
    acting.pass_time(20.0)
    assert acting.asked == ["update", "view", "act"] and not acting.ends


def test_a_node_that_is_held_loses_nothing(acting: Rig) -> None:
    acting.tell("model_updater", 1, "held by a signal")
    acting.pass_time(100.0)
    acting.tell("model_updater", 0, "back")
    acting.pass_time(1.0)
    assert not acting.ends and acting.started == [0]


def test_an_episode_does_not_outlive_its_belief(acting: Rig) -> None:
    acting.tell("model_updater", 2)
    assert acting.ends == ["error: model_updater killed by SIGKILL; its belief is lost"]
    acting.pass_time(50.0)
    assert acting.started == [0]  # the next one waits for the node
    acting.tell("model_updater", 0, "back")
    acting.pass_time(1.0)
    assert acting.started == [0, 1]
    acting.ready(1)
    assert acting.asked[-1] == "update"


def test_a_motion_that_was_given_up_is_begun_anew_from_a_new_image(acting: Rig) -> None:
    for again in range(3):
        acting.give_up_motion()
        acting.pass_time(0.5)
        assert acting.asked[-1] == "update" and not acting.ends, again
        acting.answer_update()
        assert acting.asked[-1] == "act"
    acting.give_up_motion()
    acting.pass_time(0.5)
    assert acting.ends == ["error: tool_arm joint states paused: motion given up"]


def test_a_run_from_before_ends_its_episode_at_once(estimate: Any) -> None:
    from samrl_ros.nodes.supervisor import Supervisor, SupervisorSettings

    rig = Rig(estimate)
    rig.supervisor = Supervisor(SupervisorSettings(wait_for_reset=False, episodes=2), rig)
    rig.supervisor.start()
    rig.ready(0)
    rig.answer_update()
    rig.answer_view()
    rig.give_up_motion()
    assert rig.ends == ["error: tool_arm joint states paused: motion given up"]


def test_an_all_clear_that_the_cell_does_not_share_is_waited_out(acting: Rig) -> None:
    from samrl_ros.conversions import to_message
    from samrl_ros.nodes.standstill import LATCHED
    from samrl_ros.nodes.supervisor import SAFETY

    acting.refusal = LATCHED
    acting.give_up_motion()
    for _ in range(3):  # and an episode ends while another says that all is well
        acting.supervisor.handle(SAFETY, to_message.diagnostic("cell: command guard", 0, "ok", {}))
    acting.tell("model_updater", 2)
    acting.tell("model_updater", 0, "back")
    acting.pass_time(60.0)
    assert len(acting.ends) == 1 and not acting.supervisor.finished
    asked = len(acting.started)
    assert asked > 10 and set(acting.started[1:]) == {1}
    acting.refusal = ""
    acting.pass_time(1.0)
    acting.ready(1)
    assert acting.asked[-1] == "update" and len(acting.started) == asked + 1


def test_a_cell_that_refuses_for_another_reason_ends_the_run(acting: Rig) -> None:
    from samrl_core.common.errors import InputError

    acting.refusal = "the task starts elsewhere"
    acting.tell("model_updater", 2)
    acting.tell("model_updater", 0, "back")
    with pytest.raises(InputError, match="the task starts elsewhere"):
        acting.pass_time(5.0)
    assert acting.supervisor.finished
