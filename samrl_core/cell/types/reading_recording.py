"""Readings of a sensor against their reference: depth against planes, stamps against another clock."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.errors import InputError

UNITS = {"depth": "m", "stamp": "s"}  # quantity -> unit


@dataclass(frozen=True)
class ReadingTolerances(StatedTolerances):
    """How far a sensor may be off and still count as nominal: half widths, unless `stated_as` differs."""

    depth_scale: float = 0.0005  # as a fraction
    depth_offset: float = 0.0005  # of the sensor's origin along its axis [m]
    depth_pattern: float = 0.0005  # errors that last over neighbouring readings, as a fraction of the depth
    stamp: float = 0.0005  # constant offset of the clocks [s]
    drift: float = 1e-6  # [s/s]


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
