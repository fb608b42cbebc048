"""A live view in Foxglove: a WebSocket server that forwards CDR bytes unchanged (extra `viz`)."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any

from samrl_core.common.errors import InputError
from samrl_ros.bags.schemas import Definition, definition


class LiveView:
    """A server at ws://host:port, to which Foxglove connects.

    Messages that are sent once (robot descriptions, calibration, static frames) are stored, and sent again
    whenever a client subscribes to their topic.

    Args:
        host: address to serve at.
        port: 0 lets the system choose.
        name: shown by Foxglove.
        asset: content of a `package://` file that a client asks for, None if there is none.

    Raises:
        InputError: the extra `viz` is not installed, or the port is taken.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 8765,
        name: str = "samrl cell",
        asset: Callable[[str], bytes | None] | None = None,
    ) -> None:
        self._foxglove = _foxglove()
        self._context = self._foxglove.Context()
        self._channels: dict[str, Any] = {}
        self._kept: dict[str, bytes] = {}  # topic: newest message of a latched topic
        self._now_ns = 0  # time of the message shown last
        self._lock = threading.Lock()  # clients subscribe in the server's thread
        try:
            self._server = self._foxglove.start_server(
                name=name,
                host=host,
                port=port,
                context=self._context,
                server_listener=_Listener(self),
                asset_handler=asset,
            )
        except (RuntimeError, OSError) as error:
            raise InputError(f"cannot serve at {host}:{port}: {error}; choose another port") from error

    @property
    def port(self) -> int:
        """The port in use; with port 0 the system chose it."""
        return self._server.port

    def offer(self, topic: str, type_name: str, described: Definition | None = None) -> None:
        """Let clients subscribe to a topic before its first message.

        Raises:
            InputError: a type without definition.
        """
        with self._lock:
            self._channel(topic, type_name, described)

    def is_watched(self, topic: str) -> bool:
        """Whether a client subscribes to a topic."""
        with self._lock:
            return topic in self._channels and self._channels[topic].has_sinks()

    def show(
        self,
        topic: str,
        type_name: str,
        data: bytes,
        time_ns: int,
        described: Definition | None = None,
        latched: bool = False,
    ) -> None:
        """Forward one message; a latched one goes to later clients as well.

        Raises:
            InputError: a type without definition.
        """
        with self._lock:
            self._channel(topic, type_name, described).log(data, log_time=time_ns)
            if latched:
                self._kept[topic] = data
            self._now_ns = max(self._now_ns, time_ns)

    def resend(self, topic: str) -> None:
        """Send the stored message of a latched topic again, if there is one."""
        with self._lock:
            if topic in self._kept:
                # With the present time: clients take a message of long ago for a jump of the clock.
                self._channels[topic].log(self._kept[topic], log_time=self._now_ns)

    def _channel(self, topic: str, type_name: str, described: Definition | None) -> Any:
        channel = self._channels.get(topic)
        if channel is None:
            found = described or definition(type_name)
            schema = self._foxglove.Schema(name=type_name, encoding=found.encoding, data=found.text.encode())
            channel = self._foxglove.Channel(
                topic, schema=schema, message_encoding="cdr", context=self._context
            )
            self._channels[topic] = channel
        return channel

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def __enter__(self) -> LiveView:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _Listener:
    """What the server calls in its thread; the other calls of Foxglove's protocol are not answered."""

    def __init__(self, view: LiveView) -> None:
        self._view = view

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._view.resend(channel.topic)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("on_"):
            return lambda *ignored: None
        raise AttributeError(name)


def _foxglove() -> Any:
    try:
        import foxglove
    except ImportError as error:
        raise InputError("the live view needs Foxglove's SDK: pip install 'samrl[viz]'") from error
    return foxglove
