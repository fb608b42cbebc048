"""How a node's settings are declared: frozen dataclasses whose fields carry text, unit and range.

`setting` is the one way to declare a field; `node_kit` turns it into a ROS parameter with descriptor
and range, and `msgs_docs/parameters.md` is generated from it.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any


def setting(
    default: Any,
    description: str,
    unit: str = "",
    range: tuple[float, float] | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """A dataclass field with its documentation.

    Args:
        default: value when the YAML file and the command line say nothing.
        description: one line for people.
        unit: SI unit, empty for none.
        range: lowest and highest value allowed, for numbers.
        choices: values allowed, for text.
    """
    return field(
        default=default,
        metadata={"description": description, "unit": unit, "range": range, "choices": choices},
    )
