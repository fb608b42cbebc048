"""Look: light, paint, shadows and what lies about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.instance.difference import difference

_ROOM = "ASSUMPTION: a laboratory by day and by lamp; SimplerEnv and domain randomisation vary the same"
_PAINT = "ASSUMPTION: paint and camera profile against a CAD colour"


@dataclass(frozen=True, eq=False)
class Look:
    """What changes colours and nothing else."""

    light_turn: float = difference("azimuth of the light", "rad", "uniform", 0.8, 3.1, _ROOM)
    light_drop: float = difference("elevation of the light", "rad", "uniform", 0.20, 0.45, _ROOM)
    light_strength: float = difference(
        "brightness of the light, share of it", "-", "normal", 0.08, 0.20, _ROOM
    )
    light_warmth: float = difference("red up and blue down by this share", "-", "normal", 0.05, 0.12, _ROOM)
    target_colour: np.ndarray = difference(
        "of the target, linear RGB", "-", "uniform", 0.06, 0.15, _PAINT, (3,)
    )
    tool_colour: np.ndarray = difference("of the tool, linear RGB", "-", "uniform", 0.06, 0.15, _PAINT, (3,))
    bench_colour: np.ndarray = difference(
        "of the table, linear RGB", "-", "uniform", 0.10, 0.20, _PAINT, (3,)
    )
    shadow: float = difference(
        "darkness of shadows on the table, 0 none, 1 black", "-", "share", 0.45, 0.70, _ROOM
    )
    texture: float = difference(
        "contrast of the table's grain, stains and prints", "-", "share", 0.8, 1.0, _ROOM
    )
    clutter: float = difference(
        "things that lie about, rounded to a whole number", "-", "share", 24.0, 40.0, _ROOM
    )
