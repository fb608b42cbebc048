"""Reads bags of any origin: folders, files, split, compressed, unindexed, or cut by a killed recorder."""

from __future__ import annotations

import hashlib
import heapq
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_folder, is_there
from samrl_ros.bags import metadata, scan
from samrl_ros.bags.decode import Decoder, Decoders, decode
from samrl_ros.bags.qos_metadata import QoS, load_profiles
from samrl_ros.bags.schemas import Definition
from samrl_ros.bags.writer import CUSTOM_DATA

LONGEST_PAUSE_S = 600.0  # [s] of log time without a message; more is a clock that jumped
_ROS2 = {("cdr", "ros2msg")}


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag."""

    name: str
    type: str
    count: int  # [messages]
    qos: tuple[QoS, ...]  # offered by its publishers, empty if not recorded
    type_hash: str  # RIHS01, empty if not recorded
    serialization: str
    definition: Definition  # as the bag carries it


@dataclass(frozen=True, slots=True)
class RawMessage:
    """A message as recorded."""

    topic: str
    type: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes  # CDR


@dataclass(frozen=True)
class Bag:
    """An opened bag. Reading again starts again; nothing is kept open in between."""

    path: Path
    files: tuple[Path, ...]
    topics: tuple[BagTopic, ...]  # by name
    message_count: int
    start_ns: int  # first log time
    end_ns: int  # last log time; in a truncated bag, of what could be read
    truncated: bool  # a file has no end: its recorder was killed, or it was cut or damaged
    damage: tuple[str, ...]  # where and why reading stops, one line per such file
    lost_bytes: int  # behind the damage, where nothing was read
    has_metadata: bool  # metadata.yaml is there
    custom_data: dict[str, str]
    _indexes: tuple[scan.FileIndex, ...] = field(repr=False, default=())

    def topic(self, name: str) -> BagTopic:
        """One topic. Raises `InputError` listing those present."""
        require_topics(self, (name,))
        return next(topic for topic in self.topics if topic.name == name)

    def sha256(self) -> str:
        """Of the file; of all files one after the other where the bag is split."""
        digest = hashlib.sha256()
        for file in self.files:
            with file.open("rb") as stream:
                while block := stream.read(1 << 20):
                    digest.update(block)
        return digest.hexdigest()

    @property
    def notes(self) -> tuple[str, ...]:
        """What is odd: service events, formats that are not ROS 2's, and log times that jump."""
        found = []
        if events := [t.name for t in self.topics if is_service_event(t)]:
            found.append(
                f"service events on {', '.join(events)}: calls that introspection recorded, no messages of a"
                " topic; they are kept and copied, never played or decoded as messages"
            )
        for wrong in sorted({(t.serialization, t.definition.encoding) for t in self.topics} - _ROS2):
            names = [t.name for t in self.topics if (t.serialization, t.definition.encoding) == wrong]
            found.append(
                f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} in {wrong[0] or 'no encoding'} with"
                f" schema {wrong[1] or 'none'}, not ROS 2's cdr with ros2msg; samrl copies, but does not read"
                " it: convert the bag to ROS 2 messages"
            )
        pauses = [p for p in scan.pauses(self._indexes) if p[1] - p[0] > LONGEST_PAUSE_S * 1e9]
        if pauses:
            begin, end = max(pauses, key=lambda p: p[1] - p[0])
            hours = (self.end_ns - self.start_ns) / 3.6e12
            found.append(
                f"log time jumps by {(end - begin) * 1e-9:.0f} s, from {begin * 1e-9:.3f} to"
                f" {end * 1e-9:.3f} s ({len(pauses)} such jumps), so the bag seems {hours:.1f} h long: was"
                " there a second publisher of /clock? `ros2 topic info -v /clock` names them"
            )
        return tuple(found)

    def messages(
        self, topics: Iterable[str] | None = None, near_ns: Iterable[int] | None = None
    ) -> Iterator[RawMessage]:
        """Raw messages in log-time order; equal times in recorded order.

        `topics` selects; one that the bag lacks has no messages (see `require_topics`). `near_ns` leaves out,
        unread, blocks that have none of these log times in their span, as their headers state it; of the
        other blocks all messages come. Raises `InputError` where a file that looked whole turns out to be
        damaged.
        """
        times = None if near_ns is None else sorted(near_ns)
        return self._messages(self._selected(topics), times)

    def decoded(self, topics: Iterable[str] | None = None) -> Iterator[tuple[RawMessage, Any]]:
        """Pairs of raw message and decoded object (fields as attributes), in log-time order.

        Raises `InputError` if a schema, now, or a message, when it comes, is broken.
        """
        wanted = self._selected(topics)
        return self._decoded(wanted, self._decoders(wanted))

    def decoder(self, topic: str) -> Decoder:
        """Decoder of a topic's messages, see `decode`; for readers that decode some of them.

        Raises:
            InputError: no such topic, or a schema that is broken.
        """
        return self._decoders({self.topic(topic).name})[topic]

    def _decoders(self, wanted: set[str]) -> dict[str, Decoder]:
        decoders = Decoders()
        by_topic: dict[str, Decoder] = {}
        for index in self._indexes:
            for channel in index.channels.values():
                if channel.topic in wanted:
                    schema = index.schemas.get(channel.schema_id)
                    decoder = decoders.get(channel.topic, channel.message_encoding, schema)
                    if by_topic.setdefault(channel.topic, decoder) is not decoder:
                        raise InputError(
                            f"bag {self.path}: topic {channel.topic} was recorded with two definitions of its"
                            " type; read the files one by one"
                        )
        return by_topic

    def _selected(self, topics: Iterable[str] | None) -> set[str]:
        present = {topic.name for topic in self.topics}
        if topics is None:
            return present
        return present & ({topics} if isinstance(topics, str) else set(topics))

    def _decoded(self, wanted: set[str], decoders: dict[str, Decoder]) -> Iterator[tuple[RawMessage, Any]]:
        for raw in self._messages(wanted):
            yield raw, decode(decoders[raw.topic], raw.topic, raw.log_time_ns, raw.data)

    def _messages(self, wanted: set[str], times: list[int] | None = None) -> Iterator[RawMessage]:
        # Blocks in order of their first log time; a message leaves the heap once no block that starts
        # earlier is left, so memory holds only overlapping blocks.
        blocks = sorted(
            ((block.start_ns, number, at) for number, index in enumerate(self._indexes)
             for at, block in enumerate(index.blocks) if times is None or _spans_any(block, times))
        )  # fmt: skip
        types = {topic.name: topic.type for topic in self.topics}
        heap: list[tuple[int, int, int, int, scan.Entry]] = []
        with ExitStack() as stack:
            streams = [stack.enter_context(index.path.open("rb")) for index in self._indexes]
            for start, number, at in blocks:
                while heap and heap[0][0] < start:
                    yield self._raw(heap, types)
                index = self._indexes[number]
                try:
                    entries = scan.read_block(index, streams[number], index.blocks[at])
                except scan.Damage as damage:
                    raise InputError(
                        f"{index.path} is damaged: {damage};"
                        f" `samrl bag repair {self.path}` keeps what precedes it"
                    ) from damage
                for order, entry in enumerate(entries):
                    if index.channels[entry.channel].topic in wanted:
                        heapq.heappush(heap, (entry.log_time_ns, number, at, order, entry))
            while heap:
                yield self._raw(heap, types)

    def _raw(self, heap: list[tuple[int, int, int, int, scan.Entry]], types: dict[str, str]) -> RawMessage:
        _, number, _, _, entry = heapq.heappop(heap)
        topic = self._indexes[number].channels[entry.channel].topic
        return RawMessage(topic, types[topic], entry.log_time_ns, entry.publish_time_ns, entry.data)


class BagDecoder:
    """Makes objects of the raw messages that a reader picks; a topic's decoder is made when it is needed.

    The last message is kept, for several who look at one.
    """

    def __init__(self, bag: Bag) -> None:
        self._bag = bag
        self._decoders: dict[str, Decoder] = {}
        self._last: tuple[RawMessage, Any] | None = None

    def __call__(self, raw: RawMessage) -> Any:
        """The object of one message of the bag. Raises `InputError` if schema or message is broken."""
        if self._last is not None and self._last[0] is raw:
            return self._last[1]
        if raw.topic not in self._decoders:
            self._decoders[raw.topic] = self._bag.decoder(raw.topic)
        message = decode(self._decoders[raw.topic], raw.topic, raw.log_time_ns, raw.data)
        self._last = (raw, message)
        return message


def _spans_any(block: scan.Block, times: list[int]) -> bool:
    """Whether one of these log times, in ascending order, lies within a block."""
    at = bisect_left(times, block.start_ns)
    return at < len(times) and times[at] <= block.end_ns


def open_bag(path: Path | str, verify: bool = False, ignore_metadata: bool = False) -> Bag:
    """Open a bag folder (with or without metadata.yaml) or a single .mcap file.

    Args:
        path: folder or file.
        verify: unpack and check everything now; damage then truncates the bag instead of raising later.
        ignore_metadata: use the .mcap files alone, in the order of their numbers.

    Raises:
        InputError: nothing there, no bag, an empty file, a storage or compression that cannot be read, or
            a file that metadata.yaml names is missing.
    """
    path = Path(path)
    if not is_there(path):
        raise InputError(f"no bag at {path}: there is nothing of that name")
    about = None
    if is_folder(path):
        about = None if ignore_metadata else metadata.load(path)
        files = _files_of(path, about)
    else:
        files = (path,)
    indexes = tuple(scan.index_file(file, verify) for file in files)
    spans = [index.span for index in indexes if index.span.count]
    return Bag(
        path=path,
        files=files,
        topics=_topics_of(path, indexes, about),
        message_count=sum(span.count for span in spans),
        start_ns=min((span.start_ns for span in spans), default=0),
        end_ns=max((span.end_ns for span in spans), default=0),
        truncated=any(index.damage for index in indexes),
        damage=tuple(f"{index.path.name}: {index.damage}" for index in indexes if index.damage),
        lost_bytes=sum(index.lost_bytes for index in indexes),
        has_metadata=about is not None,
        custom_data=_custom_data_of(indexes, about),
        _indexes=indexes,
    )


def is_service_event(topic: BagTopic) -> bool:
    """Whether a topic is service introspection's (REP 2012), not one that nodes publish messages on."""
    return topic.name.endswith("/_service_event") or ("/srv/" in topic.type and topic.type.endswith("_Event"))


def require_topics(bag: Bag, names: Iterable[str]) -> tuple[str, ...]:
    """The names, if the bag has them all. Raises `InputError` listing what is missing and what is there."""
    names = (names,) if isinstance(names, str) else tuple(names)
    have = {topic.name for topic in bag.topics}
    missing = [name for name in names if name not in have]
    if missing:
        present = ", ".join(sorted(have)) or "none"
        raise InputError(f"bag {bag.path} lacks {', '.join(missing)}; topics present: {present}")
    return names


def _files_of(folder: Path, about: dict[str, Any] | None) -> tuple[Path, ...]:
    if about is None:
        try:
            files = tuple(sorted(folder.glob("*.mcap"), key=scan.natural_key))
            other = sorted(p.name for p in folder.iterdir() if p.suffix in (".db3", ".zstd", ".bag"))
            inside = sorted({str(p.parent) for p in folder.glob("*/*.mcap")})
        except OSError as error:
            raise InputError(f"cannot read {folder}: {error.strerror}; check its permissions") from error
        if not files:
            hint = f" (it has {', '.join(other)}: convert it with `ros2 bag convert`)" if other else ""
            if inside:
                hint += f"; inside it are {', '.join(inside[:5])}: name one of them"
            raise InputError(f"{folder} is no bag: it holds no .mcap file{hint}")
        return files
    storage = about.get("storage_identifier", "mcap")
    if storage != "mcap":
        raise InputError(f"bag {folder} is stored as {storage}; convert it with `ros2 bag convert` to mcap")
    if about.get("compression_mode") in ("file", "FILE", "message", "MESSAGE"):
        raise InputError(
            f"bag {folder} uses rosbag2's own {about['compression_mode']} compression;"
            " convert it with `ros2 bag convert` to mcap's chunk compression"
        )
    names = about.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise InputError(
            f"{folder / metadata.FILE_NAME} names no files; `samrl bag repair {folder}` makes a new bag"
        )
    # Some old bags repeat the folder's name in front.
    files = tuple(folder / name if is_there(folder / name) else folder / Path(name).name for name in names)
    missing = [file.name for file in files if not is_there(file)]
    if missing:
        raise InputError(f"bag {folder} lacks {', '.join(missing)}, which its metadata.yaml names")
    return files


def _topics_of(
    path: Path, indexes: tuple[scan.FileIndex, ...], about: dict[str, Any] | None
) -> tuple[BagTopic, ...]:
    recorded = _recorded_topics(about)
    topics: dict[str, BagTopic] = {}
    for index in indexes:
        for number, channel in index.channels.items():
            schema = index.schemas.get(channel.schema_id)
            type_name = schema.name if schema is not None else ""
            known = topics.get(channel.topic)
            if known is not None and known.type != type_name:
                raise InputError(
                    f"bag {path}: topic {channel.topic} is recorded as {known.type} and as {type_name}"
                )
            listed = recorded.get(channel.topic, {})
            profiles = channel.metadata.get("offered_qos_profiles") or listed.get("offered_qos_profiles")
            type_hash = channel.metadata.get("topic_type_hash") or listed.get("type_description_hash") or ""
            type_hash = type_hash if isinstance(type_hash, str) else ""  # older bags hold a mapping there
            text = schema.data.decode(errors="replace") if schema is not None else ""
            topics[channel.topic] = BagTopic(
                name=channel.topic,
                type=type_name,
                count=index.counts.get(number, 0) + (known.count if known is not None else 0),
                qos=load_profiles(profiles),
                type_hash=type_hash,
                serialization=channel.message_encoding,
                definition=Definition(
                    type_name, text, type_hash, schema.encoding if schema is not None else ""
                ),
            )
    return tuple(topics[name] for name in sorted(topics))


def _recorded_topics(about: dict[str, Any] | None) -> dict[str, dict[str, Any]]:
    """`topic_metadata` of metadata.yaml by name; older bags keep QoS or hash only there."""
    entries = (about or {}).get("topics_with_message_count")
    if not isinstance(entries, list):
        return {}
    found = [entry.get("topic_metadata") for entry in entries if isinstance(entry, dict)]
    return {
        entry["name"]: entry
        for entry in found
        if isinstance(entry, dict) and isinstance(entry.get("name"), str)
    }


def _custom_data_of(indexes: tuple[scan.FileIndex, ...], about: dict[str, Any] | None) -> dict[str, str]:
    found: dict[str, str] = {}
    for index in indexes:
        found.update(index.metadata.get(CUSTOM_DATA, {}))
    listed = (about or {}).get("custom_data")
    if isinstance(listed, dict):
        found.update({str(key): str(value) for key, value in listed.items()})
    return found
