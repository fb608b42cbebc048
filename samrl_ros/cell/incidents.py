"""What a run outlasted, or ended with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Incident:
    """Something that was not as it should be, and that the run outlasted or ended with."""

    wall_s: float  # since the run was begun
    episode: int  # -1 before the first
    what: str  # estop, reset, ...
    text: str
