"""Makes a complete bag out of a truncated, damaged or unclosed one; the source is only read.

One rule for every source: all messages up to each file's first damage are copied, in log-time order, with
the source's own schemas, QoS, hashes and custom data, into one file of a new folder with metadata.yaml.
So a sound bag that only lacks metadata.yaml is copied too: it costs disk, and never risks the recording.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.writer import BagWriter, is_private


@dataclass(frozen=True)
class RepairReport:
    """Result of a repair."""

    source: Path
    destination: Path
    messages: int  # copied
    end_ns: int  # last log time copied
    lost_bytes: int  # of the source's files behind their first damage, at least
    damage: tuple[str, ...]  # where and why each damaged file stops, empty if none was damaged


def default_destination(source: Path | str) -> Path:
    """`<bag>_repaired` beside the source."""
    source = Path(source).resolve()
    return source.with_name((source.stem if source.is_file() else source.name) + "_repaired")


def repair(
    source: Path | str,
    destination: Path | str,
    compression: str = "zstd",
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> RepairReport:
    """Copy what can be read from `source` into the new bag folder `destination`.

    `on_progress` receives messages copied and messages in all. Raises `InputError` if the source is no bag,
    the destination exists or lies inside the source, or nothing at all can be kept.
    """
    source, destination = Path(source), Path(destination)
    if source.is_dir() and destination.resolve().is_relative_to(source.resolve()):
        raise InputError(f"destination {destination} lies inside the source {source}; choose another place")
    bag = open_bag(source, verify=True, ignore_metadata=True)
    if not bag.topics:
        raise InputError(f"nothing can be kept of {source}: it holds no topic; {'; '.join(bag.damage)}")
    about = {key: value for key, value in bag.custom_data.items() if not is_private(key)}
    writer = BagWriter(destination, compression=compression, custom_data=about)
    try:
        for topic in bag.topics:
            writer.add_topic(topic.name, topic.type, topic.qos, topic.definition, topic.serialization)
        for done, message in enumerate(bag.messages(), start=1):
            writer.write(message.topic, message.log_time_ns, message.data, message.publish_time_ns)
            if done % 1000 == 0:
                on_progress(done, bag.message_count)
        writer.close()
    except BaseException:
        shutil.rmtree(destination)  # half a copy must not pass for the bag; the source is all there
        raise
    on_progress(bag.message_count, bag.message_count)
    return RepairReport(source, destination, writer.message_count, bag.end_ns, bag.lost_bytes, bag.damage)
