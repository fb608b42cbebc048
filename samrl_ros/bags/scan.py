"""Walks one MCAP file record by record, whole, unindexed or cut short, and indexes its messages.

Own framing instead of the mcap library's stream reader, because that one hands out a cut record as if
it were whole (a short read is not noticed), which in a killed recorder's file would give a false message.
Record layouts: MCAP specification 0, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema, Statistics

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_ros.bags.metadata import Span

_OTHERS = {  # first bytes of what is taken for a bag of ours
    b"SQLite format 3": "is a rosbag2 SQLite file: convert it with `ros2 bag convert` to mcap",
    b"#ROSBAG V": "is a ROS 1 bag: convert it with `rosbags-convert` to mcap",
    b"\x28\xb5\x2f\xfd": "is compressed as a whole (zstd): unpack it with `zstd -d`",
    b"\x1f\x8b": "is compressed as a whole (gzip): unpack it with `gunzip`",
}
MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, crc, length of the compression's name
_CHUNK_LIMIT = 1 << 30  # [B] a larger chunk is damage: rosbag2's have less than one MB
_LAST_NS = 2**63 - 1  # of ROS times; later ones are damage
_RUN_BYTES = 1 << 20  # [B] messages outside chunks are grouped in runs of about this size

_R = TypeVar("_R")


class Damage(Exception):
    """The file cannot be read beyond here."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A message as it lies in a file."""

    channel: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes


@dataclass
class Block:
    """A chunk, or a run of messages outside chunks: bytes [begin, end) and the log times inside."""

    begin: int
    end: int
    start_ns: int
    end_ns: int = 0  # last log time inside


@dataclass
class FileIndex:
    """What one file holds."""

    path: Path
    blocks: list[Block] = field(default_factory=list)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)  # messages per channel
    span: Span = field(default_factory=Span)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    complete: bool = False  # ends with footer and magic
    lost_bytes: int = 0  # from the first damage to the end
    damage: str = ""  # where and why reading stopped, empty if it did not


def index_file(path: Path, verify: bool = False) -> FileIndex:
    """Find the messages of a file.

    A whole file with statistics is walked by its record headers only. Any other, and any with `verify`, is
    unpacked and checked up to its end or the first damage.
    Raises `InputError` if it cannot be opened or is no MCAP file.
    """
    try:
        if not is_file(path):
            raise InputError(f"{path} is a folder, pipe or device; give a bag folder or an .mcap file")
        size = path.stat().st_size
        with path.open("rb") as stream:
            magic = stream.read(len(MAGIC))
            if magic != MAGIC:
                what = "is empty" if size == 0 else "is no MCAP file (wrong first bytes)"
                stream.seek(0)
                begins = stream.read(16)
                known = next((hint for start, hint in _OTHERS.items() if begins.startswith(start)), "")
                raise InputError(f"{path} {known or what}; give a bag folder or an .mcap file")
            if not verify:
                index = _Walk(path, stream, size, unpack=False).run()
                if index is not None:
                    return index
            index = _Walk(path, stream, size, unpack=True).run()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    assert index is not None  # a walk that unpacks always gives an index
    return index


class _Walk:
    """One pass over a file."""

    def __init__(self, path: Path, stream: BinaryIO, size: int, unpack: bool) -> None:
        self._stream, self._size, self._unpack = stream, size, unpack
        self._index = FileIndex(path)
        self._statistics: Statistics | None = None
        self._chunks = 0
        self._in_summary = False
        self._position = 0  # of the record being read

    def run(self) -> FileIndex | None:
        """The index; None where only unpacking can tell."""
        index = self._index
        try:
            self._records()
        except Damage as damage:
            index.damage = str(damage)
            index.lost_bytes = max(0, self._size - self._position)
        if self._unpack:
            return index
        counted = self._statistics
        if not index.complete or counted is None or counted.chunk_count != self._chunks:
            return None
        if any(channel not in index.channels for channel in counted.channel_message_counts):
            return None
        index.counts = dict(counted.channel_message_counts)
        index.span = Span(counted.message_count, counted.message_start_time, counted.message_end_time)
        if sum(index.counts.values()) != counted.message_count:
            return None
        return index

    def _records(self) -> None:
        position = len(MAGIC)
        while True:
            self._position = position
            self._stream.seek(position)
            header = self._stream.read(_RECORD.size)
            if len(header) < _RECORD.size:
                raise Damage(f"file ends at byte {position} without a footer")
            opcode, length = _RECORD.unpack(header)
            end = position + _RECORD.size + length
            if opcode == 0:
                raise Damage(f"no record at byte {position}")
            if end > self._size:
                raise Damage(f"file ends inside the record at byte {position}")
            if opcode == Opcode.FOOTER:
                self._stream.seek(end)
                if self._stream.read(len(MAGIC)) != MAGIC:
                    raise Damage(f"no closing magic at byte {end}")
                self._index.complete = True
                return
            self._record(opcode, position, length)
            position = end

    def _record(self, opcode: int, position: int, length: int) -> None:
        index = self._index
        if opcode == Opcode.DATA_END:
            self._in_summary = True
        elif opcode == Opcode.CHUNK and not self._in_summary:
            self._chunk(position, length)
        elif opcode == Opcode.MESSAGE and not self._in_summary:
            head = self._stream.read(_MESSAGE.size)
            if length < _MESSAGE.size:
                raise Damage(f"message record at byte {position} is too short")
            channel, _, log_time, publish_time = _MESSAGE.unpack(head)
            if max(log_time, publish_time) > _LAST_NS:
                raise Damage(f"message at byte {position} has the time {log_time} ns")
            if channel not in index.channels:
                raise Damage(f"message at byte {position} belongs to unknown channel {channel}")
            self._loose(position, position + _RECORD.size + length, log_time)
            self._count(channel, log_time)
        elif opcode == Opcode.CHANNEL:
            channel = _parse(Channel, self._stream.read(length), position)
            index.channels.setdefault(channel.id, channel)
        elif opcode == Opcode.SCHEMA:
            schema = _parse(Schema, self._stream.read(length), position)
            index.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.METADATA:
            record = _parse(Metadata, self._stream.read(length), position)
            index.metadata[record.name] = record.metadata
        elif opcode == Opcode.STATISTICS:
            self._statistics = _parse(Statistics, self._stream.read(length), position)

    def _chunk(self, position: int, length: int) -> None:
        self._chunks += 1
        end = position + _RECORD.size + length
        if not self._unpack:
            head = self._stream.read(_CHUNK.size)
            if length < _CHUNK.size:
                raise Damage(f"chunk at byte {position} is too short")
            self._index.blocks.append(Block(position, end, *_CHUNK.unpack(head)[:2]))
            return
        channels, schemas = dict(self._index.channels), dict(self._index.schemas)
        entries = list(_chunk_entries(self._stream.read(length), position, channels, schemas))
        self._index.channels, self._index.schemas = channels, schemas  # only those of a sound chunk
        for entry in entries:
            self._count(entry.channel, entry.log_time_ns)
        if entries:
            times = [entry.log_time_ns for entry in entries]
            self._index.blocks.append(Block(position, end, min(times), max(times)))

    def _loose(self, begin: int, end: int, log_time: int) -> None:
        blocks = self._index.blocks
        last = blocks[-1] if blocks else None
        if last is not None and last.end == begin and last.end - last.begin < _RUN_BYTES:
            last.end = end
            last.start_ns = min(last.start_ns, log_time)
            last.end_ns = max(last.end_ns, log_time)
        else:
            blocks.append(Block(begin, end, log_time, log_time))

    def _count(self, channel: int, log_time: int) -> None:
        self._index.counts[channel] = self._index.counts.get(channel, 0) + 1
        self._index.span.add(log_time)


def read_block(index: FileIndex, stream: BinaryIO, block: Block) -> list[Entry]:
    """The messages of a block, in file order. Raises `Damage`."""
    stream.seek(block.begin)
    data = stream.read(block.end - block.begin)
    if len(data) < block.end - block.begin:
        raise Damage(f"file became shorter than {block.end} bytes while it was read")
    return list(_entries(data, block.begin, index.channels, index.schemas))


def _entries(
    data: bytes, origin: int, channels: dict[int, Channel], schemas: dict[int, Schema]
) -> Iterator[Entry]:
    """Messages in a run of records; channels and schemas met on the way are added."""
    position = 0
    while position < len(data):
        if position + _RECORD.size > len(data):
            raise Damage(f"record cut inside the block at byte {origin}")
        opcode, length = _RECORD.unpack_from(data, position)
        begin = position + _RECORD.size
        position = begin + length
        if position > len(data):
            raise Damage(f"record cut inside the block at byte {origin}")
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE.size:
                raise Damage(f"message record in the block at byte {origin} is too short")
            channel, _, log_time, publish_time = _MESSAGE.unpack_from(data, begin)
            if max(log_time, publish_time) > _LAST_NS:
                raise Damage(f"message in the block at byte {origin} has the time {log_time} ns")
            if channel not in channels:
                raise Damage(f"message in the block at byte {origin} belongs to unknown channel {channel}")
            yield Entry(channel, log_time, publish_time, data[begin + _MESSAGE.size : position])
        elif opcode == Opcode.CHUNK:
            yield from _chunk_entries(data[begin:position], origin, channels, schemas)
        elif opcode == Opcode.CHANNEL:
            record = _parse(Channel, data[begin:position], origin)
            channels.setdefault(record.id, record)
        elif opcode == Opcode.SCHEMA:
            record = _parse(Schema, data[begin:position], origin)
            schemas.setdefault(record.id, record)


def _chunk_entries(
    body: bytes, origin: int, channels: dict[int, Channel], schemas: dict[int, Schema]
) -> Iterator[Entry]:
    if len(body) < _CHUNK.size:
        raise Damage(f"chunk at byte {origin} is too short")
    _, _, size, crc, name_length = _CHUNK.unpack_from(body)
    start = _CHUNK.size + name_length + 8  # after the compression's name and the length of the data
    name = body[_CHUNK.size : _CHUNK.size + name_length]
    if size > _CHUNK_LIMIT or start > len(body):
        raise Damage(f"chunk at byte {origin} is damaged (sizes do not fit)")
    packed = body[start:]
    try:
        if name == b"zstd":
            # No more than is stated: a few bytes can unpack to all of the memory.
            data = zstandard.ZstdDecompressor().stream_reader(packed).read(size + 1)
        elif name == b"lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
        elif name == b"":
            data = packed
        else:
            raise Damage(f"chunk at byte {origin} has unknown compression {name.decode(errors='replace')!r}")
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError, OverflowError) as error:
        raise Damage(f"chunk at byte {origin} cannot be unpacked: {error}") from error
    if len(data) != size or (crc != 0 and zlib.crc32(data) != crc):
        raise Damage(f"chunk at byte {origin} is damaged (checksum or size differs)")
    yield from _entries(data, origin, channels, schemas)


def _parse(kind: type[_R], body: bytes, position: int) -> _R:
    try:
        return kind.read(ReadDataStream(BytesIO(body)))  # ty: ignore[missing-attribute]
    except (struct.error, ValueError, McapError, MemoryError, OverflowError) as error:
        raise Damage(f"{kind.__name__} record at byte {position} is damaged") from error


def pauses(indexes: Iterable[FileIndex]) -> list[tuple[int, int]]:
    """Spans of log time [ns] that may be without a message, as far as block headers tell.

    Between blocks, and within one: a block is about a second of messages, so one that spans far more holds
    messages of two clocks.
    """
    spans = sorted((b.start_ns, b.end_ns) for index in indexes for b in index.blocks if b.end_ns)
    found = list(spans)
    reached = spans[0][1] if spans else 0
    for start, end in spans:
        if start > reached:
            found.append((reached, start))
        reached = max(reached, end)
    return found


def natural_key(path: Path) -> tuple[str, int, str]:
    """Sorts split files by their number: bag_2.mcap before bag_10.mcap."""
    stem, _, number = path.stem.rpartition("_")
    if number.isdigit():
        return stem, int(number), path.name
    return path.stem, -1, path.name
