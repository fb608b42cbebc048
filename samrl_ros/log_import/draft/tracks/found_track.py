"""Where the numbers of a pose stand in a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from samrl_ros.log_import.draft.tracks.matrix_columns import ROWS, matrix_order, row_by_row

LEAST = 6  # rows, below which no pair of poses says anything


@dataclass(frozen=True)
class Component:
    """One number of a pose: a column, or one number of a column that holds lists."""

    column: str
    index: int | None = None


@dataclass
class FoundTrack:
    """Where the numbers of one pose, or of one position, stand in a table."""

    stem: tuple[str, ...]  # words that its names share
    columns: dict[str, list[Component]] = field(default_factory=dict)  # position, quaternion, ... -> numbers
    axes: str = "xyz"  # that the position has
    order: str = ""  # of a quaternion: xyzw by names, wxyz, or empty where nothing says it
    unit: str = ""  # of the position, where the names say it
    angle_unit: str = ""
    named: bool = True  # by its columns; else by what the numbers look like
    vague: bool = False  # a rotation vector that may as well be roll, pitch and yaw
    zeros: int = 0  # poses that are zero where nothing was seen
    time: Component | None = None  # of an array that holds it too
    angle: Component | None = None  # of a pose in a plane, beside its position

    @property
    def rotation(self) -> str:
        """What gives the rotation, a key of the mapping; empty if nothing does."""
        kinds = ("matrix", "quaternion", "rotation_matrix", "rotation_vector", "rpy")
        return next((k for k in kinds if k in self.columns), "")

    @property
    def whole(self) -> bool:
        """Whether it is a pose."""
        return self.rotation == "matrix" or bool(self.rotation and self.axes == "xyz" and self.positioned)

    @property
    def positioned(self) -> bool:
        """Whether it has a position of its own, or within a matrix."""
        return "position" in self.columns or self.rotation == "matrix"

    @property
    def used(self) -> list[str]:
        """Its columns."""
        return list(dict.fromkeys(c.column for parts in self.columns.values() for c in parts))

    @property
    def names(self) -> str:
        """Its columns, as a reader finds them."""
        return ", ".join(self.used)


def matrix_parts(parts: Sequence[Component], values: np.ndarray) -> list[Component]:
    """Numbers of a homogeneous matrix as a mapping names them, row by row; empty where they are none.

    Args:
        parts: 12 or 16 columns, or places in one.
        values: (N, 12 or 16) of them.
    """
    if not (order := matrix_order(values)):
        return []
    whole = order == ROWS and len({part.column for part in parts}) == 1
    return [Component(parts[0].column)] if whole else [parts[k] for k in row_by_row(len(parts), order)]
