"""Which stated parameters of an effect can be compared with true ones: those of one name and unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

_ANGLES = ("phi", "phase")  # the same after a whole turn


def comparable(stated: Mapping[str, Any], true: Mapping[str, Any]) -> list[tuple[str, Any, float]]:
    """(name, stated estimate, true value) of scalar parameters with an interval.

    A parameter must have the same name and unit in both. What is parametrised unlike (a link's mass error
    against its first moment, say) is left out. An angle's truth is turned to the estimate's side.
    """
    values = {
        name: float(known["value"])
        for name, known in true.items()
        if isinstance(known, dict) and isinstance(known.get("value"), int | float)
    }
    pairs = []
    for name, estimate in stated.items():
        if None in (estimate.get("ci95") or (None, None)):
            continue
        if name not in values or _unit(true[name]) != _unit(estimate):
            continue
        value = values[name]
        if name in _ANGLES:
            value += math.tau * round((float(estimate["value"]) - value) / math.tau)
        pairs.append((name, estimate, value))
    return pairs


def _unit(quantity: Mapping[str, Any]) -> str:
    """Radians are pure numbers where something is counted per angle."""
    return {"1/rad": "1"}.get(str(quantity.get("unit")), str(quantity.get("unit")))
