"""ROS bags of any kind: rosbag2 in MCAP or sqlite3, and ROS 1; a topic of one is a part.

The echo of a topic is a bag too: its one topic has no name, and its stamps stand for the recorder's clock.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_ros.bags.reader import open_bag
from samrl_ros.log_import.formats.control_msgs import RELEASES
from samrl_ros.log_import.formats.echoed_topic import is_echo, read_echo
from samrl_ros.log_import.formats.message_fields import flatten
from samrl_ros.log_import.table import Table, rows_as_column

SUFFIXES = (".mcap", ".db3", ".bag")


@dataclass(frozen=True)
class LoggedTopic:
    """A topic of a bag."""

    name: str  # empty of an echo
    type: str  # package/msg/Name, for ROS 1 too; empty of an echo whose fields no message has
    count: int  # [messages]


def is_bag(path: Path) -> bool:
    """Whether a path is a bag, by its suffix or what lies in the folder."""
    if is_folder(path):
        return is_file(path / "metadata.yaml") or any(path.glob("*.mcap"))
    return path.suffix.lower() in SUFFIXES or is_echo(path)


def list_topics(path: Path, where: str) -> tuple[LoggedTopic, ...]:
    """Topics that hold messages, by name. Raises `InputError` if the bag cannot be opened."""
    if is_mcap(path):
        return tuple(LoggedTopic(t.name, t.type, t.count) for t in open_bag(path).topics if t.count)
    if is_echo(path):
        echo = read_echo(path, where)
        return (LoggedTopic("", echo.kind, len(echo.messages)),)
    with _opened(path, where) as reader:
        found = [
            LoggedTopic(name, about.msgtype or "", about.msgcount) for name, about in reader.topics.items()
        ]
    return tuple(topic for topic in sorted(found, key=lambda t: t.name) if topic.count)


def read_span(path: Path, where: str) -> tuple[int, int]:
    """First and last log time [ns]. Raises `InputError` if the bag cannot be opened."""
    if is_mcap(path):
        bag = open_bag(path)
        return bag.start_ns, bag.end_ns
    if is_echo(path):
        stamps = [stamp for stamp, _ in read_echo(path, where).messages]
        return min(stamps), max(stamps)
    with _opened(path, where) as reader:
        return int(reader.start_time), int(reader.end_time)


def read_text_topic(path: Path, topic: str, where: str) -> str | None:
    """The last text of a std_msgs/String topic; None where there is none."""
    last = None
    for _, message in read_messages(path, topic, where):
        last = getattr(message, "data", None)
    return last if isinstance(last, str) else None


def read_frames(path: Path, topic: str, where: str) -> tuple[str, str]:
    """(child, parent) that the first message of a topic names; empty where it names none."""
    for _, message in read_messages(path, topic, where):
        parent = getattr(getattr(message, "header", None), "frame_id", "")
        return str(getattr(message, "child_frame_id", "")), str(parent)
    return "", ""


def read_topic_table(path: Path, topic: str, where: str) -> Table:
    """A topic's numbers by field, such as `position.JOINT` or `feedback.velocities.JOINT`.

    Arrays that belong to a list of names get a column per name; a message that lacks a name has NaN there.
    `Table.time` is the header's stamp, or the recorder's where no header was ever stamped.

    Raises:
        InputError: no such topic, definitions that are missing, or messages that do not fit them.
    """
    logged: list[int] = []
    rows: list[dict[str, Any]] = []
    for log_time_ns, message in read_messages(path, topic, where):
        logged.append(log_time_ns)
        rows.append(flatten(message))
    if not rows:
        present = ", ".join(t.name for t in list_topics(path, where)) or "none"
        raise InputError(f"{where}: {path.name} has no messages of {topic!r}; topics are {present}")
    table = Table(
        path,
        {
            name: column
            for name in _order(rows)
            if (column := rows_as_column([row.get(name) for row in rows])) is not None
        },
    )
    log_time = np.array(logged, dtype=np.int64) * 1e-9
    if is_echo(path):
        table.notes += read_echo(path, where).notes
    else:
        table.columns["log_time"] = log_time
    stamps = table.columns.get("header.stamp")
    if isinstance(stamps, np.ndarray) and stamps.any():
        table.time = stamps
    else:
        table.time = log_time
        table.notes.append(f"{topic}: no header is stamped; the recorder's log times are used instead")
    return table


def _order(rows: list[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row))


def is_mcap(path: Path) -> bool:
    """Whether a path is an MCAP file or a folder with some."""
    return path.suffix.lower() == ".mcap" or (is_folder(path) and any(path.glob("*.mcap")))


def read_messages(path: Path, topic: str, where: str) -> Iterator[tuple[int, Any]]:
    """Log time [ns] and decoded message, in log order. Raises `InputError` if one does not fit its type."""
    if is_mcap(path):
        for raw, message in open_bag(path).decoded([topic]):
            yield raw.log_time_ns, message
        return
    if is_echo(path):
        if topic:
            raise InputError(
                f"{where}: {path.name} is the echo of one topic, so no {topic!r}; leave `part` out"
            )
        yield from read_echo(path, where).messages
        return
    faults = []
    for release in RELEASES:
        with _opened(path, where, release) as reader:
            wanted = [connection for connection in reader.connections if connection.topic == topic]
            unknown = sorted({c.msgtype for c in wanted} - set(reader.typestore.fielddefs))
            if unknown:
                raise InputError(
                    f"{where}: {path.name} carries no definition of {', '.join(unknown)}, of {topic}; record"
                    " as MCAP (its files carry definitions), or convert the bag"
                )
            begun = False
            try:
                for connection, log_time_ns, data in reader.messages(wanted) if wanted else ():
                    message = reader.deserialize(data, connection.msgtype)
                    begun = True
                    yield log_time_ns, message
                return
            except _broken() as error:
                faults.append(f"{type(error).__name__}: {error}")
                if begun:
                    break
    raise InputError(f"{where}: {path.name}, topic {topic}: a message does not fit its type: {faults[0]}")


@contextmanager
def _opened(path: Path, where: str, release: dict[str, str] = RELEASES[-1]) -> Generator[Any]:
    """A reader of a ROS 1 bag, or of a rosbag2 folder in sqlite3."""
    import sqlite3

    import ruamel.yaml.error
    from rosbags.highlevel import AnyReader

    folder = path.parent if path.suffix.lower() == ".db3" else path
    if folder != path and not is_file(folder / "metadata.yaml"):
        raise InputError(
            f"{where}: {folder} has no metadata.yaml beside {path.name}; `ros2 bag reindex` makes it"
        )
    try:
        reader = AnyReader([folder], default_typestore=_definitions(release))
        reader.open()
    except (*_broken(), sqlite3.Error, OSError, ruamel.yaml.error.YAMLError) as error:
        raise InputError(f"{where}: {path} cannot be read as a bag: {error}") from error
    try:
        yield reader
    finally:
        reader.close()


def _broken() -> tuple[type[Exception], ...]:
    """What rosbags raises on bytes that are not what they should be."""
    import apsw  # what rosbags reads sqlite3 with
    from rosbags import rosbag1, rosbag2
    from rosbags.highlevel import AnyReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import TypesysError

    own = (AnyReaderError, rosbag1.ReaderError, rosbag2.ReaderError, SerdeError, TypesysError, apsw.Error)
    of_python = (ValueError, IndexError, KeyError, AssertionError, TypeError, AttributeError, struct.error)
    of_decompression = (EOFError, RuntimeError, OverflowError, MemoryError)
    return (*own, *of_python, *of_decompression)


def _definitions(release: dict[str, str]) -> Any:
    """Types of bags that carry no definitions: ROS 2's own, and a release of ros2_control's."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in release.items():
        store.register(get_types_from_msg(text, name))
    return store
