"""What is randomised: named numbers with a nominal value and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class Dimension:
    """One number of the model.

    Raises:
        InputError: bounds without width, or a nominal value outside them.
    """

    name: str  # `<group>/<what>`
    unit: str
    nominal: float  # the model's own
    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lower, self.upper]).all() and self.lower < self.upper):
            raise InputError(
                f"{self.name} has bounds {self.lower} and {self.upper}; they must be finite, the lower first"
            )
        if not self.lower <= self.nominal <= self.upper:
            raise InputError(
                f"{self.name} is {self.nominal} nominally, must lie within {self.lower} to {self.upper}"
            )


@dataclass(frozen=True)
class Space:
    """P numbers, in order.

    Raises:
        InputError: none, or a name twice.
    """

    dimensions: tuple[Dimension, ...]

    def __post_init__(self) -> None:
        names = self.names
        if not names or len(set(names)) < len(names):
            raise InputError(f"a space needs dimensions of different names, got {list(names)}")

    def __len__(self) -> int:
        return len(self.dimensions)

    @property
    def names(self) -> tuple[str, ...]:
        """In order."""
        return tuple(d.name for d in self.dimensions)

    @property
    def nominal(self) -> np.ndarray:
        """(P,)."""
        return np.array([d.nominal for d in self.dimensions])

    @property
    def lower(self) -> np.ndarray:
        """(P,)."""
        return np.array([d.lower for d in self.dimensions])

    @property
    def upper(self) -> np.ndarray:
        """(P,)."""
        return np.array([d.upper for d in self.dimensions])

    def columns(self, group: str) -> list[int]:
        """Which of the P are `<group>/...`."""
        return [k for k, name in enumerate(self.names) if name.split("/")[0] == group]

    def part(self, columns: Sequence[int]) -> Space:
        """Some of the dimensions."""
        return Space(tuple(self.dimensions[k] for k in columns))

    def points(self, points: np.ndarray) -> np.ndarray:
        """Points (N, P) as they are.

        Raises:
            InputError: another shape, or not finite.
        """
        found = np.asarray(points, dtype=np.float64)
        if found.ndim != 2 or found.shape[1] != len(self) or not np.isfinite(found).all():
            raise InputError(
                f"points have shape {found.shape}, must be (N, {len(self)}) finite numbers: {self.names}"
            )
        return found

    def record(self) -> list[dict[str, Any]]:
        """Plain values for JSON."""
        return [asdict(d) for d in self.dimensions]
