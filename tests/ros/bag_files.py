"""Messages of a run as a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from samrl_ros.bags.qos_metadata import topic_qos
from samrl_ros.bags.writer import BagWriter
from samrl_ros.contract.topics import FORMER_NAMES, TOPICS


def record(
    folder: Path, messages: list[tuple[int, str, Any]], custom_data: dict[str, str] | None = None
) -> Path:
    """Write messages, each with its time [ns] and topic."""
    from rclpy.serialization import serialize_message

    with BagWriter(folder, custom_data=custom_data) as bag:
        for time_ns, topic, message in messages:
            present = FORMER_NAMES.get(topic, topic)
            bag.add_topic(topic, TOPICS[present].type, topic_qos(present))
            bag.write(topic, time_ns, serialize_message(message))
    return folder
