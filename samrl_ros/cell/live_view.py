"""`samrl cell --view`: a node that forwards what is recorded to Foxglove, bytes unchanged."""

from __future__ import annotations

import threading
import time
from functools import partial

from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from samrl_ros.bags.visualise import LiveView
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import LATCHED, NAMESPACE, STATIC_TF, TOPICS


class LiveViewNode:
    """Subscribes raw to every recorded topic, in a thread of its own."""

    def __init__(self, view: LiveView) -> None:
        self._view = view
        self._node = Node("live_view", namespace=NAMESPACE)
        for topic in TOPICS.values():
            if topic.recorded:
                forward = partial(self._forward, topic.name, topic.type, topic.qos in (LATCHED, STATIC_TF))
                self._node.create_subscription(
                    message_class(topic.type), topic.name, forward, qos_named(topic.qos), raw=True
                )
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live_view", daemon=True)
        self._thread.start()

    def _forward(self, topic: str, type_name: str, latched: bool, data: bytes) -> None:
        self._view.show(topic, type_name, data, time.time_ns(), latched=latched)

    def _run(self) -> None:
        executor = EventsExecutor()
        executor.add_node(self._node)
        while not self._stop.is_set():
            executor.spin_once(timeout_sec=0.05)
        executor.remove_node(self._node)
        executor.shutdown()

    def close(self) -> None:
        """Stop forwarding and serving."""
        self._stop.set()
        self._thread.join(5.0)
        self._node.destroy_node()
        self._view.close()


def start_live_view() -> LiveViewNode:
    """Serve at ws://127.0.0.1:8765.

    Raises:
        InputError: the extra `viz` is not installed, or the port is taken.
    """
    return LiveViewNode(LiveView())
