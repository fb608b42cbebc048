"""Writes rosbag2-compatible MCAP bags from raw CDR bytes, so that a killed process loses about a second.

Conventions are rosbag2's (Jazzy): profile `ros2`, `ros2msg` schemas, QoS and type hash on the channel,
metadata version 9. What differs is safety: chunks are small and handed to the operating system at
least every `flush_period_s` of wall time while messages arrive.
"""

from __future__ import annotations

import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

import yaml
from mcap.writer import CompressionType, Writer

from samrl_core.common.errors import InputError
from samrl_core.common.files import NO_ROOM, no_room
from samrl_ros.bags import metadata
from samrl_ros.bags.chunk_index import keep_index_on_disk
from samrl_ros.bags.qos_metadata import QoS, dump_profiles
from samrl_ros.bags.schemas import Definition, definition

COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
CUSTOM_DATA = "samrl"  # name of the MCAP metadata record that keeps custom data in a killed bag
_PRIVATE = ("seed", "truth")  # what only evaluation may know


class _Sink:
    """An unbuffered file: what was written has reached the operating system."""

    def __init__(self, path: Path) -> None:
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._position = 0

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        while view:  # a nearly full disk takes part of it before it refuses
            written = os.write(self._fd, view)
            self._position += written
            view = view[written:]
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        pass

    def sync(self) -> None:
        os.fsync(self._fd)

    def close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


class BagWriter:
    """A bag being written: a new folder with `<folder>_0.mcap`, ... and, once closed, metadata.yaml.

    Args:
        folder: must not exist yet; its parents are made.
        compression: of each chunk: zstd, lz4 or none.
        chunk_bytes: uncompressed size at which a chunk is written.
        flush_period_s: longest wall time [s] that a message stays in this process while others arrive.
        custom_data: what may be known about the run: schema version, task, code version. Seeds and
            ground truth are refused.
        ros_distro: as in rosbag2's metadata.

    Raises:
        InputError: the folder exists or cannot be made, or the disk is full. After a failed write nothing
            more is written and no metadata.yaml claims that the bag is complete.
    """

    def __init__(
        self,
        folder: Path | str,
        compression: str = "zstd",
        chunk_bytes: int = 256 * 1024,
        flush_period_s: float = 0.5,
        custom_data: dict[str, str] | None = None,
        ros_distro: str = "jazzy",
    ) -> None:
        self.folder = Path(folder)
        if compression not in COMPRESSIONS:
            raise InputError(f"compression {compression!r} is unknown; use one of {', '.join(COMPRESSIONS)}")
        if chunk_bytes < 1 or not flush_period_s >= 0:
            raise InputError(f"chunk_bytes={chunk_bytes} must be positive, {flush_period_s=} not negative")
        self._compression = COMPRESSIONS[compression]
        self._chunk_bytes = chunk_bytes
        self._flush_period_s = flush_period_s
        self._custom_data = _checked_custom_data(custom_data or {})
        self._ros_distro = ros_distro
        self._topics: dict[str, metadata.WrittenTopic] = {}
        self._files: list[metadata.WrittenFile] = []
        self._channels: dict[str, int] = {}  # of the present file
        self._schemas: dict[Definition, int] = {}  # of the present file
        self._failure = ""
        self._closed = False
        _make_folder(self.folder)
        self._open_file()

    @property
    def message_count(self) -> int:
        """Messages handed in so far."""
        return sum(file.span.count for file in self._files)

    @property
    def topics(self) -> tuple[str, ...]:
        """Names added so far."""
        return tuple(self._topics)

    @property
    def closed(self) -> bool:
        """Nothing can be written any more."""
        return self._closed

    def add_topic(
        self,
        name: str,
        type_name: str,
        qos: QoS | tuple[QoS, ...] | None = None,
        described: Definition | None = None,
        serialization: str = "cdr",
    ) -> None:
        """Announce a topic; again with the same type does nothing.

        `described` replaces the installed definition: a copy of a bag keeps its source's definition.
        Raises `InputError` for an unknown type, or one that differs from the topic's first.
        """
        if described is None and not name.startswith("/"):
            raise InputError(f"topic name {name!r} must be absolute, starting with /")
        known = self._topics.get(name)
        if known is not None:
            if known.definition.type != type_name:
                raise InputError(
                    f"topic {name} was recorded as {known.definition.type}, now {type_name} arrives;"
                    " one topic of a bag has one type"
                )
            return
        profiles = qos if isinstance(qos, tuple) else (qos or QoS(),)
        self._topics[name] = metadata.WrittenTopic(
            name, profiles, described or definition(type_name), serialization, copied=described is not None
        )

    def write(self, name: str, log_time_ns: int, data: bytes, publish_time_ns: int | None = None) -> None:
        """Append one message.

        Args:
            name: a topic announced before.
            log_time_ns: receive time [ns] of the bag's clock; decides the order of reading.
            data: CDR with its 4-byte header, as `raw=True` subscriptions give it.
            publish_time_ns: send time or header stamp [ns]; the log time if absent.
        """
        topic = self._topics.get(name)
        if topic is None:
            raise InputError(
                f"topic {name} was not added to {self.folder}; present: {', '.join(self._topics)}"
            )
        if len(data) < 4 and not topic.copied:
            raise InputError(f"{name}: {len(data)} bytes are no CDR message, whose header alone has 4")
        if publish_time_ns is None:
            publish_time_ns = log_time_ns
        if not (0 <= log_time_ns < 2**63 and 0 <= publish_time_ns < 2**63):
            raise InputError(
                f"{name}: log time {log_time_ns} and publish time {publish_time_ns} ns must be in [0, 2^63)"
            )
        self._refuse_if_ended()
        try:  # not `_writing`: this is the one place where its microseconds count
            channel = self._channels.get(name)
            if channel is None:
                channel = self._register(topic)
            self._writer.add_message(channel, log_time_ns, data, publish_time_ns)
            topic.count += 1
            self._files[-1].span.add(log_time_ns)
            self._flush_if_due()
        except OSError as error:
            raise self._fail(error) from error

    def flush(self) -> None:
        """Hand everything written so far to the operating system; it then outlives this process."""
        with self._writing():
            self._writer.flush()
            self._flushed = time.monotonic()

    def flush_if_due(self) -> None:
        """`flush` if the last one is longer ago than the flush period: for loops that may fall silent."""
        with self._writing():
            self._flush_if_due()

    def split(self) -> Path:
        """Finish the present file and go on in a new one, whose path is returned."""
        with self._writing():
            self._finish_file()
            self._open_file()
        return self.folder / self._files[-1].name

    def close(self) -> None:
        """Finish the file and write metadata.yaml. Safe to call again, also after a failure."""
        if self._closed:
            return
        if self._failure:
            self._sink.close()
            self._closed = True
            return
        with self._writing():
            self._finish_file()
            metadata.save(self.folder, self._information())
        self._closed = True

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def _writing(self) -> Generator[None]:
        self._refuse_if_ended()
        try:
            yield
        except OSError as error:
            raise self._fail(error) from error

    def _refuse_if_ended(self) -> None:
        if self._failure:
            raise InputError(self._failure)
        if self._closed:
            raise InputError(f"the bag {self.folder} is closed")

    def _fail(self, error: OSError) -> InputError:
        """End the writing; the error to raise."""
        self._failure = (
            f"{no_room(self.folder, error)}; recording stopped, and"
            f" `samrl bag repair {self.folder}` keeps what was written"
            if error.errno in NO_ROOM
            else f"cannot write the bag {self.folder}: {error.strerror or error}; recording stopped."
            f" `samrl bag repair {self.folder}` keeps what was written"
        )
        self._sink.close()
        return InputError(self._failure)

    def _open_file(self) -> None:
        file = metadata.WrittenFile(f"{self.folder.name}_{len(self._files)}.mcap")
        self._files.append(file)
        self._channels.clear()
        self._schemas.clear()
        self._flushed = time.monotonic()
        try:
            self._sink = _Sink(self.folder / file.name)
            self._writer = Writer(
                cast(IO[bytes], self._sink),
                chunk_size=self._chunk_bytes,
                compression=self._compression,
                enable_crcs=True,
            )
            keep_index_on_disk(self._writer, self.folder)
            self._writer.start(profile="ros2", library="samrl")
            if self._custom_data:
                self._writer.add_metadata(CUSTOM_DATA, self._custom_data)
        except OSError as error:
            path = self.folder / file.name
            why = no_room(path, error) if error.errno in NO_ROOM else f"cannot write {path}: {error.strerror}"
            raise InputError(why) from error

    def _register(self, topic: metadata.WrittenTopic) -> int:
        described = topic.definition
        if described not in self._schemas:
            self._schemas[described] = self._writer.register_schema(
                described.type, described.encoding, described.text.encode()
            )
        about = {"offered_qos_profiles": dump_profiles(topic.qos), "topic_type_hash": described.type_hash}
        channel = self._writer.register_channel(
            topic.name, topic.serialization, self._schemas[described], about
        )
        self._channels[topic.name] = channel
        return channel

    def _flush_if_due(self) -> None:
        now = time.monotonic()
        if now - self._flushed >= self._flush_period_s:
            self._writer.flush()
            self._flushed = now

    def _finish_file(self) -> None:
        for topic in self._topics.values():  # also those that stayed silent are listed in the file
            if topic.name not in self._channels:
                self._register(topic)
        about = yaml.safe_dump(self._information(), sort_keys=False, allow_unicode=True)
        self._writer.flush()
        self._writer.add_metadata("rosbag2", {"serialized_metadata": about})
        self._writer.finish()
        self._sink.sync()
        self._sink.close()

    def _information(self) -> dict[str, object]:
        return metadata.information(
            list(self._topics.values()), self._files, self._custom_data, self._ros_distro
        )


def is_private(key: str) -> bool:
    """Custom data of this name does not belong in a bag."""
    return any(word in key.lower() for word in _PRIVATE)


def _checked_custom_data(custom_data: dict[str, str]) -> dict[str, str]:
    for key, value in custom_data.items():
        if not isinstance(key, str) or not isinstance(value, str):
            raise InputError(f"custom data {key!r}: {value!r} must be text; convert it with str()")
        if is_private(key):
            raise InputError(f"custom data {key!r} does not belong in a bag: only evaluation may know it")
    return dict(custom_data)


def _make_folder(folder: Path) -> None:
    if folder.exists() or folder.is_symlink():
        raise InputError(f"bag folder {folder} exists already; choose another name or move it away")
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise InputError(
            f"cannot make the bag folder {folder}: {error.strerror}; choose a writable place"
        ) from error
