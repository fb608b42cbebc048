"""What a node does, apart from how it is hosted.

A `Behaviour` is driven by messages alone: it reads no wall clock, owns no timer and draws no
unseeded random number. The same object therefore runs on a live graph (`node_kit`), and in one
thread over a recorded bag (`replay`), where two runs give identical outputs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Protocol


class Outbox(Protocol):
    """Outputs of a behaviour: messages, service calls and log lines."""

    def publish(self, topic: str, message: Any) -> None:
        """Send a message on a topic of `samrl_ros.contract.topics.TOPICS`."""
        ...

    def log(self, level: str, text: str) -> None:
        """`level` is debug, info, warn or error."""
        ...

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        """Call a service without waiting. In a replay nothing is called and nothing answers."""
        ...


class Behaviour(ABC):
    """One node's logic. Implementations are final; settings come as one frozen dataclass."""

    name: str  # of the node
    inputs: tuple[str, ...]  # topics it hears, in no particular order
    outputs: tuple[str, ...]  # topics it may speak on
    # Messages that may wait, of inputs for which the QoS keeps too few while the node computes.
    queues: Mapping[str, int] = MappingProxyType({})

    @abstractmethod
    def handle(self, topic: str, message: Any) -> None:
        """Take one message. An exception means that the node cannot go on."""

    def start(self) -> None:  # noqa: B027 (optional)
        """Called once when the node becomes active, before any message."""

    def stop(self) -> None:  # noqa: B027 (optional)
        """Called once when the node ceases to be active: what was started beside it ends."""

    def status(self) -> dict[str, str]:
        """Key figures for /diagnostics."""
        return {}
