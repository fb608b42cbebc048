"""How a node's settings are declared: frozen dataclasses whose fields carry text, unit and range.

`setting` is the one way to declare a field; `node_kit` turns it into a ROS parameter with descriptor
and range, and `msgs_docs/reference/parameters.md` is generated from it.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import field
from typing import Any

JUDGES = ("model", "operator")  # who says whether an episode of a real cell succeeded; the first by default
REAL_TIME_FACTOR = 1.0  # default upper bound of simulated over wall time, 0 for none
OUTLASTS_STOPS = True  # default: an emergency stop is waited out; false as in runs from before it was
IMAGES_KEPT = 64  # after a request; a busy computer updates the model with a late one


def setting(
    default: Any,
    description: str,
    unit: str = "",
    range: tuple[float, float] | None = None,
    choices: tuple[str, ...] = (),
    former: str = "",
) -> Any:
    """A dataclass field with its documentation.

    Args:
        default: value when neither YAML file nor command line sets it.
        description: one line for people.
        unit: SI unit, empty for none.
        range: lowest and highest value allowed, for numbers.
        choices: values allowed, for text.
        former: how older parameter files name it: `parameter`, or `node.parameter` if it was another node's.
    """
    return field(
        default=default,
        metadata={
            "description": description,
            "unit": unit,
            "range": range,
            "choices": choices,
            "former": former,
        },
    )


def why_refused(field: dataclasses.Field[Any], value: Any) -> str:
    """Why a value does not fit a field, with the limit; empty when it fits."""
    metadata = field.metadata
    unit = f" {metadata['unit']}" if metadata.get("unit") else ""
    items = value if isinstance(field.default, tuple) else (value,)
    for number in items:
        if isinstance(number, bool) or not isinstance(number, int | float):
            continue
        if not math.isfinite(number):
            return f"parameter {field.name} = {number} is not finite"
        if metadata.get("range"):
            low, high = metadata["range"]
            if not low <= number <= high:
                return f"parameter {field.name} = {number}{unit} is outside {low} .. {high}{unit}"
    if metadata.get("choices") and value not in metadata["choices"]:
        return f"parameter {field.name} = {value!r} is none of {', '.join(metadata['choices'])}"
    return ""
