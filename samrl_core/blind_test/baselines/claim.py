"""Diagnosis of a world by a baseline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Claim:
    """One cause, or none where both are None; `score` orders claims of one baseline."""

    family: str | None
    place: str | None
    score: float

    def as_report(self) -> Mapping[str, Any]:
        """In the shape of a report, so that the same scores apply."""
        if self.family is None:
            return {"verdict": "no_gap", "effects": [], "where": [], "unexplained_fraction": 0.0}
        named = {**asdict(self), "probability": 0.0, "role": "primary", "parameters": {}}
        return {"verdict": "effect", "effects": [named], "where": [], "unexplained_fraction": 0.0}


NOTHING = Claim(None, None, 0.0)
