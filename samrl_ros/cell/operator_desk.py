"""Between a real cell and whoever runs it: shows what is asked, and passes on what is typed."""

from __future__ import annotations

import os
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


class TypedLines:
    """Lines from a file descriptor as they come, none kept back in a buffer of Python's."""

    def __init__(self, file: int) -> None:
        self._file = file
        self._begun = b""  # of a line
        self.ended = False

    def take(self) -> list[str]:
        """Whole lines since the last call, without their ends; never waits."""
        while not self.ended and self._is_ours() and select.select([self._file], [], [], 0.0)[0]:
            data = os.read(self._file, 4096)
            self.ended = not data
            self._begun += data
        *whole, self._begun = self._begun.split(b"\n")
        return [line.decode(errors="replace") for line in whole]

    def _is_ours(self) -> bool:
        """Whoever reads a terminal in the background is stopped by the system, and the arms with it."""
        return not os.isatty(self._file) or os.tcgetpgrp(self._file) == os.getpgrp()


class OperatorDesk:
    """A node in the caller's thread; call `spin` often.

    A line answers the question that was shown when it was typed. One that came before is no answer: an Enter
    too many would let the arms move while somebody still lays the scene.
    """

    def __init__(self, tell: Callable[[str], None], keyboard: int | None = None) -> None:
        """`tell` shows a line; `keyboard` is what lines come from, by default stdin if it is a terminal."""
        self._tell = tell
        stdin = sys.stdin.fileno() if keyboard is None and sys.stdin.isatty() else None
        file = stdin if keyboard is None else keyboard
        self._keyboard = None if file is None else TypedLines(file)
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
        typed = [] if self._keyboard is None else self._keyboard.take()
        if typed and self.waits:
            self._on_line(typed[0])
        self._executor.spin_once(timeout_sec=0.0)

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
            reads = self._keyboard is not None and not self._keyboard.ended
            typed = f" ({TYPED[self.asks]})" if reads else ""
            self._tell(f"operator: {question.text}{typed}")

    def _on_judgement(self, message: Any) -> None:
        self.judged += 1

    def _on_line(self, line: str) -> None:
        if self.asks == "scene":
            self._ready.call_async(Trigger.Request()).add_done_callback(self._on_answer)
        elif line.strip().lower() in ("y", "yes", "n", "no"):
            request = SetBool.Request(data=line.strip().lower().startswith("y"))
            self._judge.call_async(request).add_done_callback(self._on_answer)
        else:
            self._tell("operator: type y or n")

    def _on_answer(self, future: Any) -> None:
        self._tell(f"operator: {future.result().message}")
