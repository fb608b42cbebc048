"""A `Behaviour` on a live graph."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, final

from rclpy.client import Client
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.task import Future

from samrl_core.common.errors import InputError
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import SERVICES, TOPICS
from samrl_ros.hosting.cell_node import ACTIVE, CellNode
from samrl_ros.hosting.deafness import SOUNDING, Deafness
from samrl_ros.hosting.diagnostics import TopicCounter

MakeBehaviour = Callable[[Any, Outbox], Behaviour]  # (settings, outbox); a Behaviour class is one
_MAKING = (
    threading.Lock()
)  # Warp loads its kernels in one thread at a time; nodes of a process start together
SERVICE_WAIT_S = 20.0  # ASSUMPTION: a server of the cell is up or restarted within this wall time
RESPONSE_WAIT_S = 120.0  # ASSUMPTION: laying out a scene, the slowest answer, takes less on a loaded computer


@dataclass
class _Call:
    """A service call under way: not sent yet while `sent` is None."""

    service: str
    request: Any
    on_response: Callable[[Any], None]
    deadline: float  # monotonic [s]
    sent: Future | None = None


@final
class BehaviourNode(CellNode):
    """Subscriptions, publishers and service clients for one behaviour, which runs only while active."""

    def __init__(
        self, make_behaviour: MakeBehaviour, settings_type: type[Any], name: str, **node_options: Any
    ) -> None:
        super().__init__(name, settings_type, **node_options)
        self._make = make_behaviour
        self._behaviour: Behaviour | None = None
        self._outputs: dict[str, Any] = {}
        self._inputs: list[Any] = []
        self._clients_by_name: dict[str, Client] = {}
        self._calls: list[_Call] = []
        self._deafness = Deafness()

    # --- hooks of CellNode ---

    def set_up(self, settings: Any) -> None:
        """Make the behaviour and connect its topics."""
        with _MAKING:
            behaviour = self._make(settings, _NodeOutbox(self))
        self._behaviour = behaviour
        for name in behaviour.outputs:
            topic = _topic(name)
            self.health.published[name] = 0
            self._outputs[name] = self.create_publisher(message_class(topic.type), name, qos_named(topic.qos))
        for name in behaviour.inputs:
            topic = _topic(name)
            counter = self.health.topics[name] = TopicCounter()
            events = SubscriptionEventCallbacks(message_lost=partial(_count_lost, counter))
            self._inputs.append(
                self.create_subscription(
                    message_class(topic.type),
                    name,
                    # One argument exactly: the events executor crashes on callbacks with two.
                    partial(self._receive, name, counter),
                    qos_named(topic.qos, behaviour.queues.get(name, 0)),
                    event_callbacks=events,
                )
            )

    def begin(self) -> None:
        """Start the behaviour."""
        assert self._behaviour is not None
        self._deafness = Deafness()
        self._behaviour.start()

    def halt(self) -> None:
        """Forget calls under way and stop the behaviour; nothing is handled or sent any more."""
        self._calls.clear()
        if self._behaviour is not None:
            self._behaviour.stop()

    def tear_down(self) -> None:
        """Disconnect and drop the behaviour: a configured node starts from nothing."""
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        for client in self._clients_by_name.values():
            self.destroy_client(client)
        self._inputs, self._outputs, self._clients_by_name = [], {}, {}
        self._behaviour = None

    def figures(self) -> dict[str, str]:
        """The behaviour's own."""
        return self._behaviour.status() if self._behaviour is not None else {}

    # --- messages ---

    def report(self) -> None:
        """See `CellNode`; a node that nothing reaches fails, so that somebody starts another one."""
        sounding = [name for name in SOUNDING if name in self.health.topics]
        if sounding and self.stage == ACTIVE and not self.failure:
            received = sum(counter.received for counter in self.health.topics.values())
            publishers = 0 if received else sum(self.count_publishers(name) for name in sounding)
            if why := self._deafness.look(received, publishers):
                self.fail(why)
        super().report()

    def _receive(self, topic: str, counter: TopicCounter, message: Any) -> None:
        counter.received += 1
        counter.window += 1
        behaviour = self._behaviour
        if self.stage != ACTIVE or self.failure or behaviour is None:
            counter.ignored += 1
            return
        if hasattr(message, "header"):
            stamp = message.header.stamp
            counter.age_s = 1e-9 * self.get_clock().now().nanoseconds - (stamp.sec + 1e-9 * stamp.nanosec)
        self.guard(f"handling {topic}", behaviour.handle, topic, message)

    def send(self, topic: str, message: Any) -> None:
        """Publish for the behaviour. Raises InputError for a topic that it did not name as an output."""
        assert self._behaviour is not None
        if topic not in self._behaviour.outputs:
            raise InputError(f"{self.get_name()} published on {topic}, which is not among its outputs")
        if self.stage != ACTIVE or self.failure:
            self.health.unsent += 1
            return
        self._outputs[topic].publish(message)
        self.health.published[topic] += 1

    # --- services ---

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        """Call a service of the cell; sent as soon as its server is there, without blocking."""
        if service not in self._clients_by_name:
            known = {entry.name: entry.type for entry in SERVICES}
            if service not in known:
                raise InputError(f"unknown service {service}; known are {', '.join(known)}")
            self._clients_by_name[service] = self.create_client(message_class(known[service]), service)
        self._calls.append(_Call(service, request, on_response, time.monotonic() + SERVICE_WAIT_S))
        self._advance_calls()

    def settle(self) -> None:
        """See `CellNode`; service calls move on as well."""
        if self._calls:
            self._advance_calls()
        super().settle()

    def _advance_calls(self) -> None:
        now = time.monotonic()
        for call in list(self._calls):
            if call.sent is None and self._clients_by_name[call.service].service_is_ready():
                call.sent = self._clients_by_name[call.service].call_async(call.request)
                call.deadline = now + RESPONSE_WAIT_S
            elif call.sent is not None and call.sent.done():
                self._calls.remove(call)
                self.guard(f"answer of {call.service}", call.on_response, call.sent.result())
            elif now > call.deadline:
                self._calls.remove(call)
                missing = "is not there" if call.sent is None else "does not answer"
                waited = SERVICE_WAIT_S if call.sent is None else RESPONSE_WAIT_S
                self.fail(f"service {call.service} {missing} after {waited:.0f} s; is its node running?")


class _NodeOutbox:
    """The `Outbox` of a behaviour on a node."""

    def __init__(self, node: BehaviourNode) -> None:
        self._node = node

    def publish(self, topic: str, message: Any) -> None:
        self._node.send(topic, message)

    def log(self, level: str, text: str) -> None:
        self._node.log(level, text)

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        self._node.call(service, request, on_response)


def _topic(name: str) -> Any:
    if name not in TOPICS:
        raise InputError(f"unknown topic {name}; samrl_ros/contract/topics.py lists the topics of the cell")
    return TOPICS[name]


def _count_lost(counter: TopicCounter, event: Any) -> None:
    counter.lost = event.total_count
