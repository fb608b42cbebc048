"""Whole topics of JointState and JointTrajectory, CDR to arrays and back, thousands of messages at a time.

Messages of one topic nearly always share one layout: same names, same lengths. So the first message is
walked field by field, and all that agree with it in every byte but stamp and numbers are taken as one
array. What differs starts a group of its own. Plain CDR (OMG DDS-XTypes 7.4.3), both byte orders.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from samrl_core.common.errors import InputError

JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
QUANTITIES = {
    JOINT_STATE: ("position", "velocity", "effort"),
    JOINT_TRAJECTORY: ("position", "velocity", "acceleration", "effort"),  # of its one point
}
_GROUPS_AT_ONCE = 32  # layouts searched over whole topics; beyond, messages are taken one by one
_NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class JointGroup:
    """Messages of one topic that name the same joints and carry the same quantities."""

    index: np.ndarray  # (n,) index among the topic's messages
    names: tuple[str, ...]  # K joints, empty where the sender left them out
    values: dict[str, np.ndarray]  # quantity: (n, K); those that the messages leave empty are missing


@dataclass(frozen=True, eq=False)
class JointMessages:
    """A decoded topic, in recorded order."""

    stamp_ns: np.ndarray  # (N,) int64, header stamp (plus the point's time_from_start)
    groups: tuple[JointGroup, ...]


@dataclass
class _Layout:
    """Where the numbers of a message lie; offsets count from the body, behind the 4-byte header."""

    names: tuple[str, ...] = ()
    numbers: dict[str, tuple[int, int]] = field(default_factory=dict)  # quantity: (offset, count)
    durations: tuple[int, ...] = ()  # offsets of time_from_start, if any
    end: int = 0  # of the content; serializers may leave padding behind it


class _CdrCursor:
    """Reads a message in order."""

    def __init__(self, body: bytes, order: str) -> None:
        self.body, self.order, self.position = body, order, 0

    def count(self) -> int:
        start = -(-self.position // 4) * 4
        self.position = start + 4
        return struct.unpack_from(self.order + "I", self.body, start)[0]

    def text(self) -> str:
        size = self.count()
        raw = self.body[self.position : self.position + size]
        if len(raw) < size:
            raise struct.error("a text is cut")
        self.position += size
        return raw.rstrip(b"\0").decode()

    def doubles(self) -> tuple[int, int]:
        count = self.count()
        start = -(-self.position // 8) * 8 if count else self.position
        self.position = start + 8 * count
        if self.position > len(self.body):
            raise struct.error(f"{self.position - len(self.body)} bytes are missing")
        return start, count


def _layout(kind: str, data: bytes) -> _Layout:
    if len(data) < 12 or data[0] != 0 or data[1] not in (0, 1):
        raise struct.error(f"the header {data[:4].hex()} is not plain CDR")
    walk = _CdrCursor(data[4:], "<" if data[1] else ">")
    walk.position = 8  # stamp
    walk.text()  # frame
    names = tuple(walk.text() for _ in range(_bounded(walk.count(), walk.body)))
    layout = _Layout(names)
    if kind == JOINT_TRAJECTORY:
        points = walk.count()
        if points != 1:
            raise InputError(
                f"a command message holds {points} points; the command topic carries one point a message,"
                " what the controller tracks at that stamp: record that, or import the log with a mapping"
            )
    for quantity in QUANTITIES[kind]:
        offset, count = walk.doubles()
        if count not in (0, len(names)) and names:
            raise InputError(
                f"a message has {count} numbers of {quantity} for {len(names)} joints {list(names)};"
                " give one per joint, or none"
            )
        if count:
            layout.numbers[quantity] = (offset, count)
    if kind == JOINT_TRAJECTORY:
        start = -(-walk.position // 4) * 4
        struct.unpack_from(walk.order + "iI", walk.body, start)
        layout.durations = (start,)
        walk.position = start + 8
    layout.end = walk.position
    return layout


def _bounded(count: int, body: bytes) -> int:
    if count > len(body):
        raise struct.error(f"{count} names cannot lie in {len(body)} bytes")
    return count


def decode_topic(kind: str, topic: str, messages: Sequence[bytes]) -> JointMessages:
    """All messages of one topic.

    Args:
        kind: JOINT_STATE or JOINT_TRAJECTORY.
        topic: for the messages of errors.
        messages: CDR with its 4-byte header, in recorded order.

    Raises:
        InputError: a message that does not fit its type (topic and number are named), a command with
            several points, or a count of numbers that is neither none nor one per joint.
    """
    stamps = np.zeros(len(messages), dtype=np.int64)
    groups: list[JointGroup] = []
    sizes = np.array([len(m) for m in messages], dtype=np.int64)
    for size in np.unique(sizes):
        where = np.flatnonzero(sizes == size)
        rows = np.frombuffer(b"".join(messages[i] for i in where.tolist()), dtype=np.uint8).reshape(
            len(where), size
        )
        done = 0
        while len(where):
            try:
                layout = _layout(kind, rows[0].tobytes())
            except (struct.error, UnicodeDecodeError) as error:
                raise InputError(
                    f"topic {topic}, message {where[0]}: {size} bytes are no {kind}: {error}"
                ) from error
            except InputError as error:
                raise InputError(f"topic {topic}, message {where[0]}: {error}") from error
            if done < _GROUPS_AT_ONCE:
                same = (rows[:, _fixed(layout, int(size))] == rows[0, _fixed(layout, int(size))]).all(axis=1)
            else:  # hardly two alike: one by one
                same = np.zeros(len(rows), dtype=bool)
                same[0] = True
            stamps[where[same]] = _stamps(rows[same], layout)
            groups.append(JointGroup(where[same], layout.names, _values(rows[same], layout)))
            where, rows, done = where[~same], rows[~same], done + 1
    return JointMessages(stamps, _merged(groups))


def _fixed(layout: _Layout, size: int) -> np.ndarray:
    """Mask of the bytes that decide about the layout: all but stamp, numbers and duration."""
    mask = np.ones(size, dtype=bool)
    mask[4:12] = False
    mask[4 + layout.end :] = False
    for offset, count in layout.numbers.values():
        mask[4 + offset : 4 + offset + 8 * count] = False
    for offset in layout.durations:
        mask[4 + offset : 12 + offset] = False
    return mask


def _view(rows: np.ndarray, offset: int, size: int, code: str) -> np.ndarray:
    order = "<" if rows[0, 1] else ">"
    return np.ascontiguousarray(rows[:, 4 + offset : 4 + offset + size]).view(order + code)


def _stamps(rows: np.ndarray, layout: _Layout) -> np.ndarray:
    total = np.zeros(len(rows), dtype=np.int64)
    for offset in (0, *layout.durations):
        total += _view(rows, offset, 4, "i4")[:, 0].astype(np.int64) * _NS
        total += _view(rows, offset + 4, 4, "u4")[:, 0].astype(np.int64)
    return total


def _values(rows: np.ndarray, layout: _Layout) -> dict[str, np.ndarray]:
    return {
        quantity: _view(rows, offset, 8 * count, "f8").astype(float)
        for quantity, (offset, count) in layout.numbers.items()
    }


def _merged(groups: list[JointGroup]) -> tuple[JointGroup, ...]:
    """Groups of the same names and quantities joined: padding or frame may have told them apart."""
    alike: dict[tuple[tuple[str, ...], tuple[str, ...]], list[JointGroup]] = {}
    for group in groups:
        alike.setdefault((group.names, tuple(group.values)), []).append(group)
    return tuple(
        JointGroup(
            np.concatenate([g.index for g in many]),
            names,
            {q: np.concatenate([g.values[q] for g in many]) for q in quantities},
        )
        for (names, quantities), many in alike.items()
    )


def encode_topic(
    kind: str, stamp_ns: np.ndarray, names: Sequence[str], values: dict[str, np.ndarray | None]
) -> list[bytes]:
    """CDR of every message, header included; the reverse of `decode_topic`.

    Args:
        kind: JOINT_STATE or JOINT_TRAJECTORY (one point, time_from_start zero).
        stamp_ns: (N,) [ns].
        names: J joints.
        values: quantity: (N, J); missing or None is left empty.
    """
    body = bytearray(8) + struct.pack("<I", 1) + b"\0"  # stamp, empty frame
    offsets: dict[str, int] = {}

    def align(size: int) -> None:
        body.extend(bytes(-len(body) % size))

    def count(value: int) -> None:
        align(4)
        body.extend(struct.pack("<I", value))

    count(len(names))
    for name in names:
        raw = name.encode() + b"\0"
        count(len(raw))
        body.extend(raw)
    if kind == JOINT_TRAJECTORY:
        count(1)
    for quantity in QUANTITIES[kind]:
        present = values.get(quantity) is not None
        count(len(names) if present else 0)
        if present:
            align(8)
            offsets[quantity] = len(body)
            body.extend(bytes(8 * len(names)))
    if kind == JOINT_TRAJECTORY:
        align(4)
        body.extend(bytes(8))
    rows = np.tile(np.frombuffer(b"\0\1\0\0" + bytes(body), dtype=np.uint8), (len(stamp_ns), 1))
    sec, nanosec = np.divmod(np.asarray(stamp_ns, dtype=np.int64), _NS)
    rows[:, 4:8] = sec.astype("<i4").view(np.uint8).reshape(-1, 4)
    rows[:, 8:12] = nanosec.astype("<u4").view(np.uint8).reshape(-1, 4)
    for quantity, offset in offsets.items():
        block = np.ascontiguousarray(values[quantity], dtype="<f8")
        rows[:, 4 + offset : 4 + offset + 8 * len(names)] = block.view(np.uint8).reshape(len(rows), -1)
    whole, size = rows.tobytes(), rows.shape[1]
    return [whole[i : i + size] for i in range(0, len(whole), size)]


def encode_text(text: str) -> bytes:
    """CDR of a std_msgs/String."""
    raw = text.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<I", len(raw)) + raw


def decode_text(topic: str, data: bytes) -> str:
    """Text of a std_msgs/String. Raises `InputError` naming the topic."""
    try:
        if len(data) < 8 or data[0] != 0 or data[1] not in (0, 1):
            raise struct.error(f"the header {data[:4].hex()} is not plain CDR")
        return _CdrCursor(data[4:], "<" if data[1] else ">").text()
    except (struct.error, UnicodeDecodeError) as error:
        raise InputError(f"topic {topic}: {len(data)} bytes are no std_msgs/String: {error}") from error
