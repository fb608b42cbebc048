"""`samrl cell --view`: a node that forwards what is recorded to Foxglove, bytes unchanged."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from functools import partial

from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.bags.visualise import LiveView
from samrl_ros.cell.report.pictures import COLOR, MODEL, difference_image
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import LATCHED, NAMESPACE, STATIC_TF, TOPICS, cell_topic
from samrl_ros.conversions.from_message import image

DIFFERENCE = cell_topic("live_view/difference")
CAMERA_IMAGES = 50  # kept for the model image that belongs to one of them; 5 s


class Difference:
    """Camera image minus model image of the same instant, for viewers alone: no topic of the graph."""

    def __init__(self) -> None:
        self._camera: OrderedDict[int, bytes] = OrderedDict()  # CDR by stamp [ns]; decoded only when wanted

    def take(self, topic: str, type_name: str, data: bytes) -> bytes:
        """Take a message as it came; a CDR image when it completes a pair, else nothing."""
        if topic == COLOR:
            self._camera[header_stamp_ns(type_name, data) or 0] = data
            if len(self._camera) > CAMERA_IMAGES:
                self._camera.popitem(last=False)
        camera = self._camera.get(header_stamp_ns(type_name, data) or 0) if topic == MODEL else None
        if camera is None:
            return b""
        drawn = deserialize_message(data, message_class(type_name))
        real, model = image(deserialize_message(camera, message_class(type_name))), image(drawn)
        if real.shape != model.shape:
            return b""
        drawn.data = difference_image(real, model).tobytes()
        drawn.step = model.shape[1] * 3
        return serialize_message(drawn)


class LiveViewNode:
    """Subscribes raw to every recorded topic, in a thread of its own."""

    def __init__(self, view: LiveView) -> None:
        self._view = view
        self._difference = Difference()
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
        found = self._difference.take(topic, type_name, data)
        if found:
            self._view.show(DIFFERENCE, type_name, found, time.time_ns())

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
