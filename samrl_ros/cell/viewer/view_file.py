"""`samrl bag view`: a copy of a bag that holds what `samrl cell --view` shows, to be opened in Foxglove."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from samrl_core.cell.robots.cells import DEFAULT_CELL
from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import Bag, open_bag
from samrl_ros.bags.schemas import definition
from samrl_ros.bags.writer import BagWriter, is_private
from samrl_ros.cell.viewer.meshes import by_value
from samrl_ros.cell.viewer.viewer_messages import MADE, TAKEN, ViewerMessages
from samrl_ros.contract.topics import TOPICS


def default_destination(source: Path) -> Path:
    """`<bag>_view` beside the source."""
    source = source.resolve()
    return source.with_name((source.stem if source.is_file() else source.name) + "_view")


def write_view(
    source: Path,
    destination: Path,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Copy a bag of the cell, with differences, clouds, views and meshes; the source is only read.

    Returns:
        Messages added to those of the source.

    Raises:
        InputError: no bag, one that does not tell its task, or a destination that exists or lies inside it.
    """
    if source.is_dir() and destination.resolve().is_relative_to(source.resolve()):
        raise InputError(f"{destination} lies inside the bag {source}; choose another place")
    bag = open_bag(source)
    made = ViewerMessages(_task(bag), bag.custom_data.get("cell", DEFAULT_CELL), mesh_url=by_value)
    about = {key: value for key, value in bag.custom_data.items() if not is_private(key)}
    writer = BagWriter(destination, custom_data=about)
    added = 0
    try:
        kept = [topic for topic in bag.topics if topic.name not in MADE]
        for topic in kept:
            writer.add_topic(topic.name, topic.type, topic.qos, topic.definition, topic.serialization)
        for topic, type_name in MADE.items():
            writer.add_topic(topic, type_name, (), definition(type_name), "cdr")
        names = frozenset(topic.name for topic in kept)
        for done, raw in enumerate(bag.messages(names), start=1):
            known = raw.topic in TAKEN and raw.type == TOPICS[raw.topic].type
            for shown in made.take(raw.topic, raw.data) if known else ():
                if shown.topic == raw.topic:
                    raw = replace(raw, data=shown.data)  # the description with meshes stands in for it
                else:
                    writer.write(shown.topic, raw.log_time_ns, shown.data)
                    added += 1
            writer.write(raw.topic, raw.log_time_ns, raw.data, raw.publish_time_ns)
            if done % 500 == 0:
                on_progress(done, bag.message_count)
        writer.close()
    except BaseException:
        shutil.rmtree(destination)  # half a copy must not pass for the bag
        raise
    return added


def _task(bag: Bag) -> str:
    task = bag.custom_data.get("task", "")
    if not task:
        raise InputError(
            f"{bag.path} does not tell its task: no recording of this cell; open the bag itself in Foxglove"
        )
    return task
