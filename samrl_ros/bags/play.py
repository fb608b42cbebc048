"""Plays a bag over DDS, with `/clock`.

Bytes and the order within a topic are the recorded ones. The order across topics is not: DDS does not keep
it, so repeatable replay happens in process (`samrl replay` without `--publish`).
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from samrl_core.common.errors import InputError, LimitError
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.reader import Bag, RawMessage, is_service_event

CLOCK = "/clock"
_CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
_CDR_CLOCK = struct.Struct("<4siI")  # CDR header (little endian), seconds, nanoseconds
_WAIT_S = 0.05  # [s] longest sleep, so that a stop is obeyed at once


@dataclass(frozen=True)
class PlayReport:
    """What was published."""

    published: dict[str, int]  # messages per topic, without /clock
    stopped: bool  # before the end


def publish(bag: Bag, rate: float = 1.0, topics: Iterable[str] | None = None) -> PlayReport:
    """Play a bag from a node of our own, with a progress bar.

    Starts and stops ROS. Raises as `publish_from`, and KeyboardInterrupt, after all is closed, when SIGINT or
    SIGTERM ended it early.
    """
    import rclpy
    from rich.console import Console
    from rich.progress import Progress

    from samrl_ros.hosting.host import on_graph, stop_signals

    with stop_signals() as stop, Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(f"playing {bag.path} at {rate:g}x", total=None)
        with on_graph([]) as closers:
            node = rclpy.create_node("player")
            closers.append(node.destroy_node)
            report = publish_from(
                node,
                bag,
                rate,
                topics,
                stop,
                on_progress=lambda done, total: progress.update(task, completed=done, total=total),
            )
    if report.stopped:
        raise KeyboardInterrupt
    return report


def publish_from(
    node: Any,
    bag: Bag,
    rate: float = 1.0,
    topics: Iterable[str] | None = None,
    stop: threading.Event | None = None,
    discovery_s: float = 1.0,
    ready: Callable[[], bool] = lambda: True,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> PlayReport:
    """Publish a bag's messages from a given rclpy node, paced by log time.

    The first message of each transient-local topic goes out before the clock starts, so that whoever waits
    for a description has it. `/clock` is published before each new log time; a recorded `/clock` is not
    played beside it.

    Args:
        node: an rclpy node; needs no spinning.
        bag: what to play.
        rate: speed, 1 is real time.
        topics: which; all by default.
        stop: set it to end early, for example from a signal handler.
        discovery_s: wall time [s] to let subscribers find the publishers.
        ready: asked from then on until it holds; the clock starts after it.
        on_progress: receives messages published and in all.

    Raises:
        LimitError: the rate is not positive and finite.
        InputError: a message type is not installed, or a message cannot be read.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise LimitError(f"play rate {rate} must be positive and finite, for example 1.0 for real time")
    stop = stop or threading.Event()
    chosen = {t.name: t for t in bag.topics} if topics is None else {n: bag.topic(n) for n in topics}
    chosen = {
        name: topic
        for name, topic in chosen.items()
        if name != CLOCK and topic.count > 0 and not is_service_event(topic)
    }
    # The clock is offered first, so that whoever finds the other topics knows that their time is simulated.
    clock = _publisher(node, CLOCK, _CLOCK_TYPE, QoS(reliability="best_effort", depth=1))
    publishers = {t.name: _publisher(node, t.name, t.type, _offered(t.qos)) for t in chosen.values()}
    stop.wait(discovery_s)
    while not (ready() or stop.is_set()):
        stop.wait(_WAIT_S)
    run = _Run(
        publishers, clock, stop, rate, bag.start_ns, sum(t.count for t in chosen.values()), on_progress
    )
    try:
        latched = [topic.name for topic in chosen.values() if _offered(topic.qos).latched]
        run.send_first(bag, latched)
        run.send_paced(bag, chosen)
    finally:
        for publisher in (*publishers.values(), clock):
            node.destroy_publisher(publisher)
    return PlayReport(run.published, stop.is_set() and run.done < run.total)


class _Run:
    """The state of one playback."""

    def __init__(
        self,
        publishers: dict[str, Any],
        clock: Any,
        stop: threading.Event,
        rate: float,
        start_ns: int,
        total: int,
        on_progress: Callable[[int, int], None],
    ) -> None:
        self._publishers, self._clock, self._stop = publishers, clock, stop
        self._rate, self._start_ns, self._on_progress = rate, start_ns, on_progress
        self.total = total
        self.done = 0
        self.published: dict[str, int] = dict.fromkeys(publishers, 0)
        self._sent_first: set[str] = set()

    def send_first(self, bag: Bag, latched: list[str]) -> None:
        """The first message of each latched topic."""
        missing = set(latched)
        for message in bag.messages(latched):
            if message.topic in missing:
                missing.discard(message.topic)
                self._sent_first.add(message.topic)
                self._send(message)
            if not missing or self._stop.is_set():
                return

    def send_paced(self, bag: Bag, names: Iterable[str]) -> None:
        """All others, each at its log time divided by the rate."""
        began = time.monotonic()
        last_ns = -1
        for message in bag.messages(names):
            if message.topic in self._sent_first:
                self._sent_first.discard(message.topic)
                continue
            due = began + (message.log_time_ns - self._start_ns) * 1e-9 / self._rate
            while (left := due - time.monotonic()) > 0 and not self._stop.is_set():
                self._stop.wait(min(left, _WAIT_S))
            if self._stop.is_set():
                return
            if message.log_time_ns != last_ns:
                last_ns = message.log_time_ns
                self._clock.publish(clock_bytes(last_ns))
            self._send(message)

    def _send(self, message: RawMessage) -> None:
        self._publishers[message.topic].publish(message.data)
        self.published[message.topic] += 1
        self.done += 1
        self._on_progress(self.done, self.total)


def clock_bytes(time_ns: int) -> bytes:
    """CDR of a rosgraph_msgs/Clock."""
    return _CDR_CLOCK.pack(b"\x00\x01\x00\x00", time_ns // 1_000_000_000, time_ns % 1_000_000_000)


def _offered(qos: tuple[QoS, ...]) -> QoS:
    return qos[0] if qos else QoS()


def _publisher(node: Any, name: str, type_name: str, qos: QoS) -> Any:
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    from samrl_ros.contract.message_types import message_class

    try:
        profile = QoSProfile(
            reliability=ReliabilityPolicy[qos.reliability.upper()],
            durability=DurabilityPolicy[qos.durability.upper()],
            history=HistoryPolicy[qos.history.upper()],
            depth=qos.depth,
        )
    except KeyError as error:
        raise InputError(f"topic {name}: QoS {qos} cannot be offered by a publisher") from error
    return node.create_publisher(message_class(type_name), name, profile)
