"""Run the nodes' handlers over a recorded bag, in one thread, in recorded order.

A DDS replay keeps the order within a topic but not across topics, so it cannot be repeated exactly; this
can. Simulated time is that of the recorded stamps, and nothing waits.
"""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.behaviour import Behaviour
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.topics import FORMER_NAMES, LATER_TOPICS


@dataclass
class RecordingOutbox:
    """Digest of a behaviour's messages; a service call goes nowhere."""

    digests: dict[str, Any] = field(default_factory=lambda: defaultdict(hashlib.sha256))
    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    kept: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    logs: list[tuple[str, str]] = field(default_factory=list)
    keep: frozenset[str] = frozenset()  # topics whose messages are stored whole

    def publish(self, topic: str, message: Any) -> None:
        """See `Outbox`."""
        self.digests[topic].update(canonical_bytes(message))
        self.counts[topic] += 1
        if topic in self.keep:
            self.kept[topic].append(message)

    def log(self, level: str, text: str) -> None:
        """See `Outbox`."""
        self.logs.append((level, text))

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        """See `Outbox`: the recorded cell has already answered, on its topics."""


def canonical_bytes(message: Any) -> bytes:
    """Bytes that depend on a message's content alone.

    Serialised CDR will not do: rclpy leaves its alignment gaps uninitialised.
    """
    parts: list[bytes] = []
    _collect(message, parts)
    return b"".join(parts)


def _collect(value: Any, parts: list[bytes]) -> None:
    if hasattr(value, "get_fields_and_field_types"):
        for name in value.get_fields_and_field_types():
            _collect(getattr(value, name), parts)
    elif isinstance(value, (bytes, bytearray, memoryview)):
        parts.append(bytes(value))
    elif isinstance(value, np.ndarray) or type(value).__name__ == "array":
        parts.append(np.asarray(value).tobytes())
    elif isinstance(value, (list, tuple)):
        parts.append(len(value).to_bytes(4, "little"))
        for item in value:
            _collect(item, parts)
    elif isinstance(value, float):
        parts.append(np.float64(value).tobytes())
    else:
        parts.append(repr(value).encode() + b"\0")


@dataclass(frozen=True)
class ReplayReport:
    """What the handlers did with a recording."""

    bag: str
    messages: int
    nodes: tuple[str, ...]
    digest: str  # over all outputs of all nodes; of later topics only what the bag has
    outputs: dict[str, dict[str, Any]]  # per topic: recorded, replayed, sha256, largest_difference
    truncated: bool
    logs: list[tuple[str, str]]

    def write(self, path: Path) -> None:
        """As JSON, replacing the file whole."""
        write_whole(path, json.dumps({"schema": 1, **self.__dict__}, indent=1))


MakeBehaviour = Callable[[RecordingOutbox], Behaviour]


def replay(
    bag_path: Path,
    make: dict[str, MakeBehaviour],
    compare: frozenset[str] = frozenset(),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> ReplayReport:
    """Feed every recorded message to the handlers that hear its topic.

    A topic that the bag holds under a former name is heard as what it is called now; the report names it as
    the bag does, so that digests of one bag can be compared across versions.

    Args:
        bag_path: bag folder or `.mcap` file.
        make: behaviour factories by node name.
        compare: output topics whose `values`-like numbers are compared with the recorded ones.
        progress: called with messages done and in all.

    Raises:
        InputError: not a bag, or it lacks the topics that a node needs to do anything.
    """
    from rclpy.serialization import deserialize_message

    bag = open_bag(bag_path)
    outboxes = {name: RecordingOutbox(keep=compare) for name in make}
    nodes = {name: factory(outboxes[name]) for name, factory in make.items()}
    now_called = {t.name: FORMER_NAMES.get(t.name, t.name) for t in bag.topics}
    present = {now_called[t.name]: t for t in bag.topics}
    for name, node in nodes.items():
        if not set(node.inputs) & set(present):
            raise InputError(
                f"{bag_path} has none of the topics that {name} hears ({', '.join(sorted(node.inputs))}); "
                "record with the cell's recorder, or choose other --nodes"
            )
    hears: dict[str, list[Behaviour]] = defaultdict(list)
    for node in nodes.values():
        for topic in node.inputs:
            hears[topic].append(node)
    published = {topic for node in nodes.values() for topic in node.outputs}
    recorded: dict[str, list[Any]] = defaultdict(list)
    classes = {t: message_class(info.type) for t, info in present.items() if t in hears or t in compare}
    for node in nodes.values():
        node.start()
    total = sum(t.count for t in bag.topics)
    done = 0
    for record in bag.messages():
        done += 1
        if done % 500 == 0:
            progress(done, total)
        topic = now_called[record.topic]
        if topic not in classes:
            continue
        message = deserialize_message(record.data, classes[topic])
        if topic in compare:
            recorded[topic].append(message)
        for node in hears.get(topic, ()):
            node.handle(topic, message)
    progress(total, total)
    return _report(str(bag_path), done, nodes, outboxes, present, published, recorded, bool(bag.truncated))


def _report(
    path: str,
    messages: int,
    nodes: dict[str, Behaviour],
    outboxes: dict[str, RecordingOutbox],
    present: dict[str, Any],
    published: Iterable[str],
    recorded: dict[str, list[Any]],
    truncated: bool,
) -> ReplayReport:
    outputs: dict[str, dict[str, Any]] = {}
    for topic in sorted(published):
        digests = [box.digests[topic].hexdigest() for box in outboxes.values() if topic in box.digests]
        entry: dict[str, Any] = {
            "recorded": present[topic].count if topic in present else 0,
            "replayed": sum(box.counts.get(topic, 0) for box in outboxes.values()),
            "sha256": digests[0] if digests else "",
        }
        replayed = [m for box in outboxes.values() for m in box.kept.get(topic, [])]
        if recorded.get(topic) and len(recorded[topic]) == len(replayed):
            entry["largest_difference"] = max(
                (_difference(a, b) for a, b in zip(recorded[topic], replayed, strict=True)), default=0.0
            )
        outputs[present[topic].name if topic in present else topic] = entry
    compared = {t: entry for t, entry in outputs.items() if t in present or t not in LATER_TOPICS}
    digest = hashlib.sha256(json.dumps(compared, sort_keys=True).encode()).hexdigest()
    logs = [entry for box in outboxes.values() for entry in box.logs]
    return ReplayReport(path, messages, tuple(nodes), digest, outputs, truncated, logs)


def _difference(a: Any, b: Any) -> float:
    """Largest absolute difference of the numbers in two messages; infinite if one lacks some of them."""
    x, y = _numbers(a), _numbers(b)
    if x.size != y.size or not np.array_equal(np.isfinite(x), np.isfinite(y)):
        return float("inf")
    return float(np.max(np.abs(x - y), where=np.isfinite(x), initial=0.0))


def _numbers(message: Any) -> np.ndarray:
    found: list[float] = []

    def walk(value: Any) -> None:
        if hasattr(value, "get_fields_and_field_types"):
            for name in value.get_fields_and_field_types():
                if name != "header":
                    walk(getattr(value, name))
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            found.append(float(value))
        elif isinstance(value, (list, tuple)):
            for item in value:
                walk(item)
        elif isinstance(value, np.ndarray) or type(value).__name__ == "array":
            found.extend(np.asarray(value, dtype=np.float64).ravel().tolist())

    walk(message)
    return np.array(found)
