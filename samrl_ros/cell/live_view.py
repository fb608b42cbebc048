"""`samrl cell --view`: forwards what is recorded to Foxglove, and adds what only viewers need."""

from __future__ import annotations

import queue
import threading
import time
from functools import partial

from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from samrl_core.common.errors import InputError
from samrl_ros.bags.visualise import LiveView
from samrl_ros.cell.viewer.meshes import asset
from samrl_ros.cell.viewer.viewer_messages import DESCRIPTIONS, MADE, TAKEN, ViewerMessages
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import LATCHED, NAMESPACE, STATIC_TF, TOPICS, Topic

QUIET_S = 10.0  # between two warnings
WAITING = 4000  # messages that may wait while a cloud is drawn; what comes then is not shown


class LiveViewNode:
    """Subscribes raw to every recorded topic; what takes time happens in a thread of its own."""

    def __init__(self, view: LiveView, task: str, cell: str) -> None:
        """Args:
        view: to forward to.
        task: by name.
        cell: by name.
        """
        self._view = view
        self._made = ViewerMessages(task, cell, view.is_watched)
        for topic, type_name in MADE.items():
            view.offer(topic, type_name)
        self._node = Node("live_view", namespace=NAMESPACE)
        self._waiting: queue.Queue[tuple[str, bytes]] = queue.Queue(WAITING)
        for topic in TOPICS.values():
            if topic.recorded:
                self._node.create_subscription(
                    message_class(topic.type),
                    topic.name,
                    partial(self._forward, topic),
                    qos_named(topic.qos),
                    raw=True,
                )
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=target, name=f"live_view_{target.__name__}", daemon=True)
            for target in (self._spin, self._make)
        ]
        for thread in self._threads:
            thread.start()

    def _forward(self, topic: Topic, data: bytes) -> None:
        if topic.name not in DESCRIPTIONS:  # of those, viewers get the one with meshes
            latched = topic.qos in (LATCHED, STATIC_TF)
            self._view.show(topic.name, topic.type, data, time.time_ns(), latched=latched)
        if topic.name in TAKEN and not self._waiting.full():
            self._waiting.put((topic.name, data))

    def _spin(self) -> None:
        executor = EventsExecutor()
        executor.add_node(self._node)
        while not self._stop.is_set():
            executor.spin_once(timeout_sec=0.05)
        executor.remove_node(self._node)
        executor.shutdown()

    def _make(self) -> None:
        while not self._stop.is_set():
            try:
                topic, data = self._waiting.get(timeout=0.05)
            except queue.Empty:
                continue
            try:
                for shown in self._made.take(topic, data):
                    self._view.show(shown.topic, shown.type, shown.data, time.time_ns(), latched=True)
            except InputError as error:  # a viewer's trouble is not the run's
                text = f"viewers miss what {topic} shows: {error}"
                self._node.get_logger().warning(text, throttle_duration_sec=QUIET_S)

    def close(self) -> None:
        """Stop forwarding and serving."""
        self._stop.set()
        for thread in self._threads:
            thread.join(5.0)
        self._node.destroy_node()
        self._view.close()


def start_live_view(task: str, cell: str) -> LiveViewNode:
    """Serve a task's run in a cell at ws://127.0.0.1:8765.

    Raises:
        InputError: the extra `viz` is not installed, or the port is taken.
    """
    return LiveViewNode(LiveView(asset=asset), task, cell)
