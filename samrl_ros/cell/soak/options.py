"""What a soak is asked to do, and the turns that it leaves."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samrl_core.cell.tasks import TASKS
from samrl_core.common.errors import InputError

TURN, SAMPLES = "turn.json", "samples.jsonl"


@dataclass(frozen=True)
class SoakOptions:
    """What a soak is asked to do."""

    out: Path = Path("out/soak")
    hours: float = 2.0  # wall time of all turns
    tasks: tuple[str, ...] = tuple(TASKS)
    episodes: int = 8  # of each turn
    seed: int = 0  # of the first episode of all; each next one adds 1
    layout: str = "split"
    keep_bags: bool = False  # 60 MB an episode


def whole_turns(out: Path) -> list[Path]:
    """Folders of the turns that came to their end, in order."""
    return sorted(path.parent for path in out.glob(f"turn-*/{TURN}"))


def read_turn(folder: Path) -> dict[str, Any]:
    """What a turn left.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return json.loads((folder / TURN).read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{folder / TURN} cannot be read ({error}); remove that turn's folder") from error
