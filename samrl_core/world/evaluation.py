"""The only door to ground truth: it leads into a file that evaluation alone opens.

`tests/architecture/test_truth.py` lists the callers of `SimulatedWorld.truth` and searches bags and
topics for what it returns.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from samrl_core.errors import InputError
from samrl_core.world.world import SimulatedWorld


class TruthLog:
    """Appends one JSON line per event; flushed at once, so that a killed process loses nothing."""

    def __init__(self, path: Path, world: SimulatedWorld) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        self._world = world

    def record(self, episode: int, seed: int, event: str) -> None:
        """Write the truth of this instant. `event` is "start" or "end"."""
        truth = self._world.truth()
        line = {
            "episode": episode,
            "seed": seed,
            "event": event,
            "stamp_ns": truth.stamp_ns,
            "body_position": {k: v.tolist() for k, v in truth.body_position.items()},
            "body_quat_xyzw": {k: v.tolist() for k, v in truth.body_quat_xyzw.items()},
            "tip_position": truth.tip_position.tolist(),
            "first_contact_ns": truth.first_contact_ns,
            "peak_contact_force": truth.peak_contact_force,
        }
        with self._path.open("a") as file:
            file.write(json.dumps(line) + "\n")


def read_truth(path: Path) -> dict[int, dict[str, dict[str, Any]]]:
    """Truth per episode and event.

    Raises:
        InputError: the file is missing.
    """
    if not path.is_file():
        raise InputError(f"no evaluation file at {path}; it is written by the simulated world's bridge alone")
    episodes: dict[int, dict[str, dict[str, Any]]] = {}
    for line in path.read_text().splitlines():
        if line.strip():
            entry = json.loads(line)
            episodes.setdefault(entry["episode"], {})[entry["event"]] = entry
    return episodes
