"""How one difference of a cell instance is declared and drawn.

A group's field is a `Difference`: a law, a size per level, a unit and a source. Drawn is a number without
unit from a stream of the field's own, which is then multiplied by the size. So a level or a scale changes how
far a cell is off and not in which direction, and a new field leaves the others as they were.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
from scipy.special import ndtr, ndtri

from samrl_core.common.errors import InputError
from samrl_core.common.streams import stream

LEVELS = ("nominal", "typical", "careless")  # nominal: the model's own cell, no difference at all
LAWS = ("normal", "uniform", "share")
CUT = 2.5  # a normal difference is at most so many standard deviations
Shape = tuple[int | str, ...]  # a role stands for the number of that arm's joints
G = TypeVar("G")


@dataclass(frozen=True)
class Difference:
    """One quantity in which a real cell differs.

    Raises:
        InputError: an unknown law, or sizes that are not 0 < typical <= careless.
    """

    meaning: str
    unit: str  # `-` for shares and counts
    law: str  # normal: standard deviation; uniform: half width; share: half the size to all of it, one-sided
    typical: float  # an installation that somebody calibrated last month
    careless: float  # one that nobody did
    source: str  # who says so; ASSUMPTION where nobody was found
    shape: Shape = ()

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise InputError(f"{self.meaning}: law {self.law!r} is none of {', '.join(LAWS)}")
        if not 0.0 < self.typical <= self.careless < np.inf:
            raise InputError(
                f"{self.meaning}: sizes {self.typical} and {self.careless} {self.unit} must rise from above 0"
            )

    def size(self, level: str) -> float:
        """At a level; 0 when nominal."""
        return {"nominal": 0.0, "typical": self.typical, "careless": self.careless}[level]

    def unit_draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Numbers of size 1; one uniform number of the generator for each."""
        u = rng.random(shape)
        if self.law == "uniform":
            return 2.0 * u - 1.0
        if self.law == "share":
            return 0.5 + 0.5 * u
        low = float(ndtr(-CUT))
        return ndtri(low + (1.0 - 2.0 * low) * u)


def difference(
    meaning: str, unit: str, law: str, typical: float, careless: float, source: str, shape: Shape = ()
) -> Any:
    """A field of a group; see `Difference`."""
    return field(metadata={"difference": Difference(meaning, unit, law, typical, careless, source, shape)})


def differences_of(group: type[Any]) -> dict[str, Difference]:
    """The declarations of a group's fields, by name."""
    return {f.name: f.metadata["difference"] for f in fields(group)}


def draw_group(
    group: type[G],
    level: str,
    seed: int,
    path: tuple[str, ...],
    joints: Mapping[str, int],
    scale: float = 1.0,
) -> G:
    """A group with each difference drawn from its own stream.

    Args:
        group: dataclass whose fields are made by `difference`.
        level: of `LEVELS`.
        seed: of the instance.
        path: names of the stream; the field's name is added.
        joints: number of joints per role.
        scale: multiplies all differences.

    Raises:
        InputError: no such level, or a scale that is negative or not finite.
    """
    if level not in LEVELS:
        raise InputError(f"no level is called {level!r}; there are: {', '.join(LEVELS)}")
    if not (np.isfinite(scale) and scale >= 0.0):
        raise InputError(f"scale {scale} of the differences must be finite and at least 0")
    values: dict[str, float | np.ndarray] = {}
    for name, one in differences_of(group).items():
        shape = tuple(joints[n] if isinstance(n, str) else n for n in one.shape)
        size = scale * one.size(level)
        drawn = size * one.unit_draw(stream(seed, *path, name), shape) if size else np.zeros(shape)
        values[name] = drawn if shape else float(drawn)
    return group(**values)
