"""What bags with the same topics tell of whether they are one machine's.

Two arms of one make have the same topics, joints and limits, and nothing in a log may tell them apart. What
can: joints that only one names, descriptions that differ, rates that differ, two recordings of one moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from samrl_ros.log_import.draft.blocks import ROS_TYPES
from samrl_ros.log_import.formats.message_fields import flatten
from samrl_ros.log_import.formats.rosbag import list_topics, read_messages, read_span

FIRST = 200  # messages that are looked at; joints of one topic may come in several
OTHER_RATE = 1.5  # times another's: a driver's own rate does not vary by so much
DATED = 10**18  # [ns] after 1970, September 2001: later stamps are a clock's, and not of a simulation
AT_ONCE = 10**9  # [ns] in common, which are no end of one part and begin of the next


@dataclass(frozen=True)
class Makings:
    """What a bag shows of the machine it was recorded on, in the topics that a draft reads."""

    name: str
    fields: frozenset[str]  # such as position.JOINT
    rates: dict[str, float]  # of each topic [Hz], at its begin; without a clock it is left out
    descriptions: dict[str, str]  # texts by topic, without spaces
    span: tuple[int, int]  # first and last log time [ns]

    def lacks(self, other: Makings, joints: Sequence[str]) -> list[str]:
        """Joints that another names and this one does not."""
        return [
            joint
            for joint in joints
            if any(field.endswith(f".{joint}") for field in other.fields)
            and not any(field.endswith(f".{joint}") for field in self.fields)
        ]

    def differs(self, other: Makings) -> list[str]:
        """What speaks against one machine, a phrase each; empty where nothing does, which proves nothing."""
        found = []
        for topic, text in self.descriptions.items():
            if other.descriptions.get(topic, text) != text:
                found.append(f"{self.name} and {other.name} differ in {topic}")
        for topic, rate in self.rates.items():
            theirs = other.rates.get(topic, rate)
            if max(rate, theirs) > OTHER_RATE * min(rate, theirs):
                found.append(
                    f"{topic} comes at {rate:.3g} Hz in {self.name}, at {theirs:.3g} Hz in {other.name}"
                )
        begin, end = max(self.span[0], other.span[0]), min(self.span[1], other.span[1])
        if begin > DATED and end - begin > AT_ONCE:
            found.append(
                f"{self.name} and {other.name} were recorded at once, for {(end - begin) * 1e-9:.3g} s:"
                " of one machine they are copies"
            )
        return found


def read_makings(bag: Path, topics: Sequence[str]) -> Makings:
    """Read the begin of some topics of a bag, and its descriptions.

    Raises:
        InputError: a bag that cannot be read.
    """
    fields: set[str] = set()
    rates: dict[str, float] = {}
    for topic in topics:
        logged, stamped = [], []
        for log_time_ns, message in islice(read_messages(bag, topic, "the log"), FIRST):
            numbers = flatten(message)
            fields |= numbers.keys()
            logged.append(1e-9 * log_time_ns)
            stamped.append(numbers.get("header.stamp", 0.0))
        times = np.array(stamped if any(stamped) else logged, dtype=float)
        if len(times) > 2 and np.ptp(times) > 0.0:
            rates[topic] = (len(times) - 1) / float(np.ptp(times))
    texts = {
        topic.name: _first_text(bag, topic.name)
        for topic in list_topics(bag, "the log")
        if topic.name.endswith("robot_description") and topic.type == "std_msgs/msg/String"
    }
    return Makings(bag.name, frozenset(fields), rates, texts, read_span(bag, "the log"))


def topics_of_joints(bag: Path, read: set[str]) -> list[str]:
    """Those of the topics read that are joint states or a controller's state."""
    return [
        topic.name for topic in list_topics(bag, "the log") if topic.name in read and topic.type in ROS_TYPES
    ]


def _first_text(bag: Path, topic: str) -> str:
    for _, message in read_messages(bag, topic, "the log"):
        return "".join(str(getattr(message, "data", "")).split())
    return ""
