"""Readings of a sensor against their reference: depth against planes, stamps against another clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from samrl_core.cell.types.arm_description import HALF_WIDTH, STANDARD_DEVIATION
from samrl_core.common.errors import InputError

UNITS = {"depth": "m", "stamp": "s"}  # quantity -> unit


@dataclass(frozen=True)
class ReadingTolerances:
    """How far a sensor may be off and still count as nominal: half widths, unless `stated_as` differs."""

    depth_scale: float = 0.0005  # as a fraction
    depth_offset: float = 0.0005  # of the sensor's origin along its axis [m]
    depth_pattern: float = 0.0005  # errors that last over neighbouring readings, as a fraction of the depth
    stamp: float = 0.0005  # constant offset of the clocks [s]
    drift: float = 1e-6  # [s/s]
    stated_as: str = HALF_WIDTH

    def __post_init__(self) -> None:
        if self.stated_as not in (HALF_WIDTH, STANDARD_DEVIATION):
            raise InputError(
                f"tolerances stated as {self.stated_as!r}; known are {HALF_WIDTH}, {STANDARD_DEVIATION}"
            )
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name != "stated_as" and not (np.isfinite(value) and value >= 0):
                raise InputError(f"tolerance {f.name} is {value}, must be finite and >= 0")

    @property
    def deviation(self) -> float:
        """Standard deviation per stated value."""
        return 1.0 if self.stated_as == STANDARD_DEVIATION else float(1.0 / np.sqrt(3.0))

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> ReadingTolerances:
        """From YAML; names as here, all optional.

        Raises:
            InputError: an unknown name (all known ones are listed) or a value that is no number.
        """
        known = {f.name for f in fields(cls)}
        if unknown := sorted(str(name) for name in set(values) - known):
            raise InputError(f"unknown tolerances {unknown}; known are {sorted(known)}")
        try:
            read: dict[str, Any] = {k: str(v) if k == "stated_as" else float(v) for k, v in values.items()}
            return cls(**read)
        except (TypeError, ValueError) as error:
            raise InputError(f"tolerances must be numbers: {error}") from error


@dataclass(frozen=True, eq=False)
class ReadingRecording:
    """Readings and what they should have been, in the quantity's unit."""

    name: str
    source: str
    sha256: str
    quantity: str  # of `UNITS`
    sensor: str
    time: np.ndarray  # (N,) [s]
    reading: np.ndarray  # (N,)
    reference: np.ndarray  # (N,) by what is trusted: the plane's distance, the other clock
    tolerances: ReadingTolerances = field(default_factory=ReadingTolerances)

    def __post_init__(self) -> None:
        if self.quantity not in UNITS:
            raise InputError(f"readings of {self.quantity!r}; known are {', '.join(UNITS)}")
        count = len(self.time)
        for name in ("time", "reading", "reference"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (count,) or not np.isfinite(value).all():
                raise InputError(f"{self.name}: {name} has shape {value.shape}, must be finite ({count},)")
        if self.quantity == "depth" and count and float(np.min(self.reference)) <= 0:
            raise InputError(
                f"{self.name}: a reference depth is {float(np.min(self.reference)):.4g} m, must be > 0;"
                " invalid readings are left out with `missing: drop_row`"
            )

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.time[-1] - self.time[0])
