"""What an episode's outcome says: that it was run to an end, or that it was given up."""

from __future__ import annotations

from typing import Any

ERROR = "error: "
TARGET_LOST = f"{ERROR}target not seen"  # the method's own failure; all other errors are the machine's


def is_given_up(reason: str) -> bool:
    """Whether an episode with this reason ended by a fault of the cell, and says nothing of the method."""
    return reason.startswith(ERROR) and not reason.startswith(TARGET_LOST)


def given_up_episodes(outcomes: dict[int, Any]) -> dict[int, str]:
    """Reasons of the episodes that were given up, by number, from their `Outcome` messages."""
    return {number: o.reason for number, o in sorted(outcomes.items()) if is_given_up(o.reason)}
