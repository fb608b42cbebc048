"""What a recorder does with messages, apart from where they come from.

Log time is the recorder's clock at reception. Under simulated time that clock has no value until the first
`/clock` message; what arrives earlier (latched descriptions above all) is held and written with the first
clock value, in order of arrival, so that nothing is lost and no message lies at time zero.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache

from samrl_core.common.errors import LimitError
from samrl_ros.bags.qos_metadata import QoS
from samrl_ros.bags.schemas import message_text
from samrl_ros.bags.type_hash import starts_with
from samrl_ros.bags.writer import BagWriter

HELD_LIMIT = (
    10_000  # [messages] ASSUMPTION: far more than descriptions; a graph without clock must not fill memory
)

LONGEST_STEP_S = 10.0  # [s] of the clock between two messages; more is another clock, or a machine that slept

_NS = 1_000_000_000
_CDR_STAMP = {1: struct.Struct("<iI"), 0: struct.Struct(">iI")}  # by the endianness byte of the CDR header


class Recorder:
    """Writes what it is given to a bag."""

    def __init__(self, writer: BagWriter, warn: Callable[[str], object] = lambda text: None) -> None:
        """`warn` is called when the clock jumps: the first time and at every tenfold."""
        self._writer, self._warn = writer, warn
        self._jumps = 0
        self._held: list[tuple[str, bytes, int | None]] = []
        self._last_ns = 0
        self._backwards = 0

    def on_raw(
        self,
        topic: str,
        type_name: str,
        qos: QoS,
        data: bytes,
        receive_ns: int | None,
        source_ns: int | None = None,
    ) -> None:
        """Take one message.

        Args:
            topic: absolute name.
            type_name: pkg/msg/Name.
            qos: what its publisher offers.
            data: CDR bytes of a raw subscription.
            receive_ns: the recorder's clock [ns]; None while it has no value.
            source_ns: header stamp or send time [ns] if known; becomes the publish time.

        Raises:
            LimitError: no clock after `HELD_LIMIT` messages.
            InputError: as `BagWriter.add_topic` and `BagWriter.write`.
        """
        self._writer.add_topic(topic, type_name, qos)
        if receive_ns is None:
            if len(self._held) >= HELD_LIMIT:
                raise LimitError(
                    f"{HELD_LIMIT} messages arrived and no /clock; start the publisher of /clock or set"
                    " use_sim_time to false"
                )
            self._held.append((topic, data, source_ns))
            return
        self._release(receive_ns)
        self._check_step(receive_ns)
        self._backwards += receive_ns < self._last_ns
        self._last_ns = receive_ns
        self._writer.write(topic, receive_ns, data, _publish_ns(source_ns, receive_ns))

    def split(self) -> str:
        """Go on in a new file, whose path is returned."""
        return str(self._writer.split())

    def flush_if_due(self) -> None:
        """For loops in which messages may stop: hand over what is older than the flush period."""
        self._writer.flush_if_due()

    def close(self) -> None:
        """Write what is still held, at time zero if no clock ever came, and close the bag."""
        if not self._writer.closed:
            self._release(0)
        self._writer.close()

    def status(self) -> dict[str, str]:
        """Key figures for diagnostics."""
        return {
            "bag": str(self._writer.folder),
            "messages": str(self._writer.message_count),
            "topics": str(len(self._writer.topics)),
            "held before clock": str(len(self._held)),
            "clock went back": str(self._backwards),
            "clock jumped": str(self._jumps),
        }

    def _check_step(self, receive_ns: int) -> None:
        step = receive_ns - self._last_ns
        if not self._last_ns or abs(step) <= LONGEST_STEP_S * _NS:
            return
        self._jumps += 1
        if str(self._jumps).rstrip("0") == "1":
            self._warn(
                f"the clock of the bag {self._writer.folder} jumped by {step / _NS:+.1f} s to"
                f" {receive_ns / _NS:.3f} s ({self._jumps} times so far): one node only may publish /clock;"
                " `ros2 topic info -v /clock` names them. The bag's duration is not to be trusted"
            )

    def _release(self, receive_ns: int) -> None:
        held, self._held = self._held, []
        for topic, data, source_ns in held:
            self._writer.write(topic, receive_ns, data, _publish_ns(source_ns, receive_ns))


def header_stamp_ns(type_name: str, data: bytes) -> int | None:
    """Stamp [ns] of a CDR message whose first field is std_msgs/Header; None for other types or no stamp."""
    if not _starts_with_header(type_name) or len(data) < 12:
        return None
    return _stamp_ns(data)


def clock_ns(data: bytes) -> int | None:
    """Time [ns] of a CDR rosgraph_msgs/Clock; None for zero, which means that no time has been set."""
    return _stamp_ns(data) if len(data) >= 12 else None


def _stamp_ns(data: bytes) -> int | None:
    seconds, nanoseconds = _CDR_STAMP[data[1] & 1].unpack_from(data, 4)
    return seconds * _NS + nanoseconds or None


@cache
def _starts_with_header(type_name: str) -> bool:
    return starts_with(type_name, message_text(type_name), "std_msgs/msg/Header")


def _publish_ns(source_ns: int | None, receive_ns: int) -> int:
    return receive_ns if source_ns is None or source_ns < 0 else source_ns
