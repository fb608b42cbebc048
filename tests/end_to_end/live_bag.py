"""What the bag of a cell that runs shows."""

from __future__ import annotations

from pathlib import Path

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import cell_topic


def count_actions(bag: Path) -> int:
    """Actions asked for so far; none while the bag, or its first chunk, is not there yet."""
    try:
        phases = [message.data for _, message in open_bag(bag).decoded([cell_topic("phase")])]
    except InputError:
        return 0
    return phases.count("act")
