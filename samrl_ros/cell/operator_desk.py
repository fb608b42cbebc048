"""Between a real cell and whoever runs it: shows what is asked, and passes on what is typed."""

from __future__ import annotations

import select
import sys
from collections.abc import Callable
from typing import Any

from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from samrl_core.common.errors import InputError
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import NAMESPACE, TOPICS, cell_topic
from samrl_ros.conversions.from_message import operator_question

REQUEST, JUDGEMENT = cell_topic("operator/request"), cell_topic("operator/judgement")
TYPED = {"scene": "or press Enter here", "judgement": "or type y or n and Enter here"}


class OperatorDesk:
    """A node in the caller's thread; call `spin` often."""

    def __init__(self, tell: Callable[[str], None], keyboard: bool | None = None) -> None:
        """`tell` shows a line; `keyboard` says whether lines are read from stdin, by default if it is one."""
        self._tell = tell
        self._keyboard = sys.stdin.isatty() if keyboard is None else keyboard
        self._node = Node("operator_desk", namespace=NAMESPACE)
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        self.asks, self.judged = "nothing", 0
        self._shown: tuple[str, int] = ("nothing", -1)
        self._ready = self._node.create_client(Trigger, cell_topic("operator/scene_ready"))
        self._judge = self._node.create_client(SetBool, cell_topic("operator/judge"))
        for name, callback in ((REQUEST, self._on_request), (JUDGEMENT, self._on_judgement)):
            topic = TOPICS[name]
            self._node.create_subscription(message_class(topic.type), name, callback, qos_named(topic.qos))

    @property
    def waits(self) -> bool:
        """Whether the cell waits for a person."""
        return self.asks != "nothing"

    def spin(self) -> None:
        """Take in what has come, and what was typed."""
        self._executor.spin_once(timeout_sec=0.0)
        if self._keyboard and self.waits and select.select([sys.stdin], [], [], 0.0)[0]:
            self._on_line(sys.stdin.readline())

    def close(self) -> None:
        """Leave the graph."""
        self._executor.remove_node(self._node)
        self._node.destroy_node()
        self._executor.shutdown()

    def _on_request(self, message: Any) -> None:
        try:
            question = operator_question(message.data)
        except InputError as error:  # another node's: what was asked before stays asked
            self._tell(f"operator: left out: {error}")
            return
        self.asks = question.asks
        if self.waits and (self.asks, question.episode) != self._shown:
            self._shown = (self.asks, question.episode)
            typed = f" ({TYPED[self.asks]})" if self._keyboard else ""
            self._tell(f"operator: {question.text}{typed}")

    def _on_judgement(self, message: Any) -> None:
        self.judged += 1

    def _on_line(self, line: str) -> None:
        if not line:  # stdin has ended
            self._keyboard = False
        elif self.asks == "scene":
            self._ready.call_async(Trigger.Request()).add_done_callback(self._on_answer)
        elif line.strip().lower() in ("y", "yes", "n", "no"):
            request = SetBool.Request(data=line.strip().lower().startswith("y"))
            self._judge.call_async(request).add_done_callback(self._on_answer)
        else:
            self._tell("operator: type y or n")

    def _on_answer(self, future: Any) -> None:
        self._tell(f"operator: {future.result().message}")
