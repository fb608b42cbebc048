"""A node of the bench: hears how a graph fares, and answers for the nodes that think, by a script."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from samrl_msgs.msg import ModelState, ToolAction, ViewTarget
from std_srvs.srv import Trigger

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import TOPICS, arm_topic, cell_topic
from samrl_ros.conversions import to_message

PHASE, OUTCOME, SAFETY = cell_topic("phase"), cell_topic("supervisor/outcome"), cell_topic("safety_state")
REQUEST, STATE = cell_topic("supervisor/request"), cell_topic("model_updater/state")
TARGET, ACTION = cell_topic("view_planner/target"), cell_topic("policy/nominal_action")
JOINTS, READY = arm_topic("tool_arm", "joint_states"), cell_topic("sim_bridge/ready")
STEP_M = 0.018  # of an action that moves to and fro
DOWN_M = 0.018  # of an action that seeks contact


@dataclass
class Heard:
    """What has been said so far, with the wall time at which it was heard."""

    phases: list[tuple[float, str]] = field(default_factory=list)
    outcomes: list[tuple[float, str]] = field(default_factory=list)
    safety: list[tuple[float, int, str, dict[str, str]]] = field(default_factory=list)
    joints_ns: int = 0  # stamp of the newest joint state
    position: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def guard(self, role: str) -> str:
        """State of an arm's command guard as last told."""
        return self.safety[-1][3].get(role, "") if self.safety else ""


class Ears:
    """Spins in a thread of its own. With `thinks`, it is model_updater, view_planner and policy at once."""

    def __init__(self, thinks: bool) -> None:
        self.heard = Heard()
        self.answering = threading.Event()  # the first update is answered once this is set
        self.down = False  # actions go down, to touch what lies there
        self._task = task_named("peg_insertion")
        self._home: np.ndarray = np.asarray(self._task.start_joints(cell_named())["tool_arm"])
        self._actions = 0
        self._node = rclpy.create_node("fault_bench")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        for topic, take in (
            (PHASE, lambda m: self.heard.phases.append((time.monotonic(), m.data))),
            (OUTCOME, lambda m: self.heard.outcomes.append((time.monotonic(), m.reason))),
            (SAFETY, self._on_safety),
            *(((JOINTS, self._on_joints), (REQUEST, self._on_request)) if thinks else ()),
        ):
            self._subscribe(topic, take)
        if thinks:
            self._speakers = {
                topic: self._node.create_publisher(
                    message_class(TOPICS[topic].type), topic, qos_named("state")
                )
                for topic in (STATE, TARGET, ACTION)
            }
        self._clients = {
            name: self._node.create_client(Trigger, cell_topic(name)) for name in ("estop", "estop_reset")
        }
        self._asked: list[Any] = []
        self._held: list[Any] = []
        self._stop = threading.Event()
        self._work: list[Callable[[], None]] = []
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def heard_by_all(self) -> bool:
        """Whether every answer and action has somebody who listens, beside the recorder."""
        return all(speaker.get_subscription_count() > 1 for speaker in self._speakers.values())

    def holds_a_request(self) -> bool:
        """Whether an update is asked for that is not answered."""
        return bool(self._held)

    def trigger(self, service: str) -> Callable[[], Any]:
        """Call a service; the function returned gives its answer, or None as long as there is none."""
        answer: list[Any] = []

        def ask() -> None:
            client = self._clients[service]
            if not client.service_is_ready():
                self._work.append(ask)  # later
                return
            client.call_async(Trigger.Request()).add_done_callback(lambda f: answer.append(f.result()))

        self._work.append(ask)
        return lambda: answer[0] if answer else None

    def close(self) -> None:
        """Leave the graph."""
        self._stop.set()
        self._thread.join()
        self._executor.shutdown()
        self._node.destroy_node()

    def _subscribe(self, topic: str, take: Callable[[Any], Any]) -> None:
        listed = TOPICS[topic]
        self._node.create_subscription(message_class(listed.type), topic, take, qos_named(listed.qos))

    def _spin(self) -> None:
        while not self._stop.is_set():
            self._executor.spin_once(timeout_sec=0.01)
            work, self._work = self._work, []
            for item in work:
                item()
            if self._held and self.answering.is_set():
                request, self._held = self._held[-1], []
                self._answer(request)

    def _on_safety(self, message: Any) -> None:
        values = {v.key: v.value for v in message.values}
        self.heard.safety.append((time.monotonic(), message.level[0], message.message, values))

    def _on_joints(self, message: Any) -> None:
        self.heard.joints_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        self.heard.position = np.array(message.position)

    def _on_request(self, message: Any) -> None:
        if message.stage == "update" and not self.answering.is_set():
            self._held.append(message)
        else:
            self._answer(message)

    def _answer(self, request: Any) -> None:
        step = {"episode": request.episode, "step": request.step}
        header = to_message.header(max(self.heard.joints_ns, self._stamp(request)))
        if request.stage == "update":
            names = [spec.name for spec in self._task.parameters()]
            state = ModelState(
                header=header, task=self._task.name, names=names, why_stopped="converged", **step
            )
            state.values = [0.5, 0.0]  # of the hole in the tool arm's base frame [m]
            state.covariance = [1e-6, 0.0, 0.0, 1e-6]
            self._speakers[STATE].publish(state)
        elif request.stage == "view":
            stay = ViewTarget(header=header, move=False, reason="the bench stays", **step)
            self._speakers[TARGET].publish(stay)
        else:
            action = ToolAction(header=header, **step)
            if self.down:
                action.nominal.z = -DOWN_M
            else:
                action.nominal.y = STEP_M if request.step % 2 == 0 else -STEP_M
            self._actions += 1
            self._speakers[ACTION].publish(action)

    @staticmethod
    def _stamp(message: Any) -> int:
        return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
