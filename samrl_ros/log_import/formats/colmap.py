"""COLMAP's images.txt: where each image of a reconstruction was taken (colmap.github.io, Output Format).

Two lines an image: number, quaternion w first and translation that take the world to the camera, camera and
name; below it its points, which may be none. Images stand in any order, but were taken as named.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.table import Table

MAKER = "COLMAP"
_TITLE = "# Image list with two lines of data per image"
_COLUMNS = ("image_number", *(f"w2c_{name}" for name in ("qw", "qx", "qy", "qz", "tx", "ty", "tz")))


def is_colmap(lines: Sequence[str]) -> bool:
    """Whether a text begins as COLMAP's list of images does."""
    return bool(lines) and lines[0].startswith(_TITLE)


def read_colmap(path: Path, lines: Sequence[str]) -> Table | None:
    """Images by their names, columns `w2c_qw` to `w2c_tz` in the reconstruction's unit; None of other texts.

    Raises:
        InputError: a line of an image that is none.
    """
    if not is_colmap(lines):
        return None
    told = [line.split() for line in lines if not line.startswith("#")][::2]
    images = [cells for cells in told if cells]
    if wrong := [cells for cells in images if len(cells) < 10]:
        raise InputError(
            f"{path.name}: an image has 10 entries in COLMAP's list, {' '.join(wrong[0])!r} none"
        )
    images.sort(key=lambda cells: cells[9])
    try:
        numbers = np.array([[float(cell) for cell in cells[:8]] for cells in images]).reshape(-1, 8)
    except ValueError as error:
        raise InputError(f"{path.name}: an image's pose in COLMAP's list is no number: {error}") from error
    return Table(path, {name: numbers[:, k].copy() for k, name in enumerate(_COLUMNS)}, maker=MAKER)
