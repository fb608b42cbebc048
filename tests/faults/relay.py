"""`python -m tests.faults.relay TOPIC=OTHER...`: passes bytes on from a topic to another name, or not.

A line on standard input sets the fault: `TOPIC MODE [AMOUNT]`. Modes: pass, drop (share), cease, delay (s),
duplicate (times), reorder (messages held back and sent the other way round), truncate (share that loses its
second half). The messages stay CDR bytes: nothing is decoded, so that what is broken stays broken.
"""

from __future__ import annotations

import random
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import TOPICS
from samrl_ros.hosting.host import start_ros
from tests.faults.processes import DOES

MODES = ("pass", "drop", "cease", "delay", "duplicate", "reorder", "truncate")


@dataclass
class Channel:
    """One topic's way, with the fault in force."""

    publisher: Any
    chance: random.Random
    mode: str = "pass"
    amount: float = 0.0
    late: deque[tuple[float, bytes]] = field(default_factory=deque)  # when to send, and what
    held: list[bytes] = field(default_factory=list)

    def set(self, mode: str, amount: float) -> None:
        """From now on; what is held back leaves in order."""
        if mode not in MODES:
            raise ValueError(f"mode {mode!r} is none of {', '.join(MODES)}")
        for data in self.held:
            self.publisher.publish(data)
        self.held.clear()
        self.mode, self.amount = mode, amount

    def take(self, data: bytes) -> None:
        """Pass a message on, or not."""
        send, mode, amount = self.publisher.publish, self.mode, self.amount
        if mode == "cease" or (mode == "drop" and self.chance.random() < amount):
            return
        if mode == "delay" or (self.late and mode == "pass"):
            self.late.append((time.monotonic() + (amount if mode == "delay" else 0.0), data))
            return
        if mode == "reorder":
            self.held.append(data)
            if len(self.held) >= amount:
                for one in reversed(self.held):
                    send(one)
                self.held.clear()
            return
        if mode == "truncate" and self.chance.random() < amount:
            data = data[: len(data) // 2]
        for _ in range(int(amount) if mode == "duplicate" else 1):
            send(data)

    def send_late(self) -> None:
        """What was delayed long enough."""
        while self.late and self.late[0][0] <= time.monotonic():
            self.publisher.publish(self.late.popleft()[1])


def main() -> int:
    """Relay until standard input ends."""
    start_ros([])
    node = rclpy.create_node("fault_relay")
    channels: dict[str, Channel] = {}
    for pair in sys.argv[1:]:
        topic, _, other = pair.partition("=")
        listed = TOPICS[topic]
        kind, qos = message_class(listed.type), qos_named(listed.qos)
        channel = Channel(node.create_publisher(kind, other, qos), random.Random(topic))
        node.create_subscription(kind, topic, partial(Channel.take, channel), qos, raw=True)
        channels[topic] = channel
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    orders: deque[str] = deque()
    ended = threading.Event()

    def listen() -> None:
        for line in sys.stdin:
            orders.append(line)
        ended.set()

    threading.Thread(target=listen, daemon=True).start()
    while not ended.is_set():
        executor.spin_once(timeout_sec=0.005)
        while orders:
            topic, mode, *amount = orders.popleft().split()
            channels[topic].set(mode, float(amount[0]) if amount else 0.0)
            print(DOES, flush=True)
        for channel in channels.values():
            channel.send_late()
    return 0


if __name__ == "__main__":
    sys.exit(main())
