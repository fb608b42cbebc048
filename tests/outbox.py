"""An outbox that keeps what a bridge says, for tests of bridges without their host."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class KeptWords:
    """Messages and log lines in their order; a bridge calls no service."""

    def __init__(self) -> None:
        self.said: list[tuple[str, Any]] = []  # topic and message
        self.logs: list[tuple[str, str]] = []  # level and text

    def publish(self, topic: str, message: Any) -> None:
        self.said.append((topic, message))

    def log(self, level: str, text: str) -> None:
        self.logs.append((level, text))

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        raise AssertionError("a bridge calls no service")

    def on(self, topic: str) -> list[Any]:
        """All messages of a topic."""
        return [message for name, message in self.said if name == topic]
