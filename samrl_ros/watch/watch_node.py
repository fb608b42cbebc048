"""The watch in a graph: joins topics as they appear, and publishes what it finds on /diagnostics."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data

from samrl_core.common.errors import InputError
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.recorder import clock_ns
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import TOPICS
from samrl_ros.watch.gap_watch import GapWatch
from samrl_ros.watch.windows import is_diagnosed

NAME = "gap_watch"
QUEUE = 10_000  # messages per topic: ten seconds at a kilohertz
JOIN_S, REPORT_S = 1.0, 1.0  # between two looks at the graph; REP-107
CLOCK = ("/clock", "rosgraph_msgs/msg/Clock")


class WatchNode:
    """A node in the caller's thread; call `spin` often."""

    def __init__(self, watch: GapWatch, note: Callable[[str], object]) -> None:
        """`note` hears which topics are taken, and which cannot be."""
        self._watch, self._note = watch, note
        self._node = Node(NAME)
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        self._publisher = self._node.create_publisher(
            DiagnosticArray, "/diagnostics", qos_named(TOPICS["/diagnostics"].qos)
        )
        self._joined: set[str] = set()
        self._clock_ns: int | None = None
        # From the start, not when a clock appears: what is told before its first stamp is heard has no time.
        self._node.create_subscription(
            message_class(CLOCK[1]), CLOCK[0], self._on_clock, qos_profile_sensor_data, raw=True
        )
        self._next_join = self._next_report = 0.0
        self.failure: Exception | None = None  # of a callback: raised where `spin` was called

    @property
    def topics(self) -> int:
        """How many were joined, without the clock."""
        return len(self._joined)

    def spin(self, timeout_s: float = 0.02) -> None:
        """Take what has arrived. Raises what a callback raised."""
        now = time.monotonic()
        if now >= self._next_join:
            self._next_join = now + JOIN_S
            self._join()
        self._executor.spin_once(timeout_sec=timeout_s)
        if self.failure is not None:
            raise self.failure
        self._watch.poll()
        if now >= self._next_report:
            self._next_report = now + REPORT_S
            self.report()

    def report(self) -> None:
        """Publish the present state."""
        well, text, values = self._watch.status()
        status = DiagnosticStatus(
            level=DiagnosticStatus.OK if well else DiagnosticStatus.WARN,
            name=NAME,
            message=text,
            hardware_id="samrl",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()
        self._node.destroy_node()

    def _join(self) -> None:
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._joined or len(types) != 1 or not is_diagnosed(topic, types[0]):
                continue
            offers = [i.qos_profile for i in self._node.get_publishers_info_by_topic(topic)]
            if not offers:
                continue  # somebody only listens there
            self._joined.add(topic)
            try:
                message = message_class(types[0])
            except InputError as error:
                self._note(f"{topic} is left out: {error}")
                continue
            profile, qos = _matching(offers)
            callback = partial(self._take, topic, types[0], qos)
            self._note(f"watching {topic}")
            lost = SubscriptionEventCallbacks(message_lost=self._on_lost)
            self._node.create_subscription(message, topic, callback, profile, raw=True, event_callbacks=lost)

    def _on_lost(self, info: Any) -> None:
        self._watch.lose(info.total_count_change)

    def _on_clock(self, data: bytes) -> None:
        self._clock_ns = clock_ns(data) or self._clock_ns

    def _take(self, topic: str, type_name: str, qos: QoS, data: bytes) -> None:
        now = self._clock_ns
        if now is None and self._node.count_publishers(CLOCK[0]):  # a simulation that has not begun
            if qos.latched:
                self._watch.describe(topic, type_name, qos, data)
            return
        try:
            self._watch.take(topic, type_name, qos, data, time.time_ns() if now is None else now)
        except (InputError, OSError) as error:  # an executor of events loses what its callbacks raise
            self.failure = self.failure or error


def _matching(offers: list[QoSProfile]) -> tuple[QoSProfile, QoS]:
    """A profile that hears every publisher of a topic, and how a bag names it."""
    reliable = all(o.reliability == ReliabilityPolicy.RELIABLE for o in offers)
    latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
    profile = QoSProfile(
        depth=QUEUE,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
    qos = QoS(
        "reliable" if reliable else "best_effort", "transient_local" if latched else "volatile", depth=QUEUE
    )
    return profile, qos
