"""What a simulator makes of one change: that, the nearest it has, a matter of its controller, nothing."""

from __future__ import annotations

from dataclasses import dataclass

EXACT, NEAREST, CONTROLLER, MISSING = "exact", "nearest", "controller", "missing"


@dataclass(frozen=True)
class Statement:
    """One line of the export's page."""

    place: str  # joint:NAME or cell
    what: str  # field of PlantParameters, or several of one kind
    how: str  # EXACT, NEAREST, CONTROLLER (in the code that commands the simulator) or MISSING
    said: str  # in words, with numbers
    error: float | None = None  # of the nearest, relative to what it stands for
