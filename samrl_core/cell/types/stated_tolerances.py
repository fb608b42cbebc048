"""What tolerances of any recording have in common: stated half widths, checked, read from YAML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.names import known_are

HALF_WIDTH, STANDARD_DEVIATION = "half_width", "standard_deviation"
DEVIATION = {HALF_WIDTH: 1.0 / np.sqrt(3.0), STANDARD_DEVIATION: 1.0}  # per stated value


@dataclass(frozen=True, kw_only=True)
class StatedTolerances:
    """How far the real system may be from its description and still count as nominal.

    Each is the half width of what is plausible, unless `stated_as` says that it is a standard deviation. The
    diagnosis takes a half width as a Gaussian with the standard deviation of a uniform draw within it.
    """

    stated_as: str = HALF_WIDTH  # or STANDARD_DEVIATION, of all of them

    def __post_init__(self) -> None:
        if self.stated_as not in DEVIATION:
            raise InputError(f"tolerances stated as {self.stated_as!r}; known are {', '.join(DEVIATION)}")
        for f in fields(self):
            if f.name == "stated_as":
                continue
            value = np.asarray(getattr(self, f.name), dtype=float)
            if not (np.isfinite(value).all() and (value >= 0).all()):
                raise InputError(f"tolerance {f.name} is {getattr(self, f.name)}, must be finite and >= 0")

    @property
    def deviation(self) -> float:
        """Standard deviation per stated value."""
        return float(DEVIATION[self.stated_as])

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """From JSON or YAML; names as in the class, all optional. Lists are values per joint.

        Raises:
            InputError: an unknown name (all known ones are listed) or a value that is no number.
        """
        known = {f.name: str(f.type) for f in fields(cls)}
        if unknown := sorted(str(name) for name in set(values) - set(known)):
            raise InputError(f"unknown tolerances {unknown}; {known_are(unknown[0], sorted(known))}")
        read: dict[str, Any] = {}
        for name, value in values.items():
            try:
                if name == "stated_as":
                    read[name] = str(value)
                elif "tuple" in known[name] and isinstance(value, list):
                    read[name] = tuple(map(_number, value))
                else:
                    read[name] = _number(value)
            except (TypeError, ValueError, OverflowError) as error:
                wanted = "a number or one for each joint" if "tuple" in known[name] else "a number"
                raise InputError(
                    f"tolerances must be numbers: {name} is {value!r}, must be {wanted}"
                ) from error
        return cls(**read)


def _number(value: Any) -> float:
    """What was written as a number; YAML's yes and no are none, though Python counts with them."""
    if isinstance(value, bool):
        raise TypeError(f"{value} is no number")
    return float(value)
