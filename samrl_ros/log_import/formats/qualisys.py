"""TSV exports of Qualisys Track Manager: lines of a key and values, then a table of markers or rigid bodies.

Markers (`DATA_INCLUDED 3D`) have three columns each, rigid bodies (`6D`) sixteen: X, Y, Z, roll, pitch, yaw,
a residual and a rotation matrix. A row of axes, frame and time stand before them only where they were asked
for. Lengths are millimetres; what was not seen is empty or three zeros (docs.qualisys.com, TSV export).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_ros.log_import.table import Table

_FIRST = ("NO_OF_FRAMES", "FILE_VERSION")
_KEY = re.compile(r"[A-Z][A-Z0-9_]+")
_WIDTHS = {"MARKER_NAMES": 3, "BODY_NAMES": 16}  # columns of each item
_TURNS = slice(3, 6)  # roll, pitch, yaw [deg]
_MATRIX = slice(7, 16)
_AGREE = 1e-3  # [rad] between a matrix and the angles beside it


def read_qualisys(path: Path, lines: Sequence[str]) -> Table | None:
    """The table of an export, columns as `ball.Position.X`, and its time; None of any other text.

    Args:
        path: of the file.
        lines: its text.

    Raises:
        InputError: the rows have not as many columns as the items that are named.
    """
    if not lines or lines[0].split("\t")[0].strip() not in _FIRST:
        return None
    head = list(takewhile(lambda line: _KEY.fullmatch(line.split("\t")[0].strip()), lines))
    told = [[cell.strip() for cell in line.split("\t")] for line in head]
    about = {
        key: [value for value in values if value] for key, *values in told
    }  # EVENT may stand there twice
    kind = next((key for key in _WIDTHS if about.get(key)), "")
    rate = _number((about.get("FREQUENCY") or [""])[0])
    if not kind or not rate > 0:
        return None
    rows = [[_number(cell) for cell in line.split("\t")] for line in lines[len(head) :] if line.strip()]
    if rows and not np.isfinite(rows[0]).any():
        del rows[0]  # names of the axes
    names, width = about[kind], _WIDTHS[kind] * len(about[kind])
    # A tab at the end of a row is a cell more; it is one of all rows, or of none.
    ends = {
        len(row) - (bool(row) and bool(np.isnan(row[-1])) and (len(row) - width) in (1, 3)) for row in rows
    }
    if not ends <= {width, width + 2}:
        raise InputError(
            f"{path.name}: {len(names)} names after {kind} need {width} columns, with frame and time"
            f" {width + 2}; its rows have {sorted(ends)}: export it anew with the names of what is in it"
        )
    lead = max(ends, default=width) - width
    cells = np.array([row[: lead + width] for row in rows if len(row) >= lead + width]).reshape(
        -1, lead + width
    )
    table = Table(path, maker="Qualisys")
    table.time = cells[:, 1] if lead else np.arange(len(cells)) / rate
    for name, block in zip(names, np.split(cells[:, lead:], len(names), axis=1), strict=True):
        block[(block[:, :3] == 0).all(axis=1)] = np.nan
        for k, axis in enumerate("XYZ"):
            table.columns[f"{name}.Position.{axis}"] = block[:, k].copy()
            table.units[f"{name}.Position.{axis}"] = "mm"
        if kind == "BODY_NAMES":
            _add_turns(name, block, table)
    return table


def _add_turns(name: str, block: np.ndarray, table: Table) -> None:
    """Quaternions of the matrices, in the order in which they agree with the angles beside them."""
    seen = np.isfinite(block).all(axis=1)
    matrices = block[seen, _MATRIX].reshape(-1, 3, 3)
    told = Rotation.from_euler("XYZ", block[seen, _TURNS], degrees=True)
    for each in (np.swapaxes(matrices, 1, 2), matrices):
        if not seen.any() or not (np.linalg.det(each) > 0).all():
            continue
        turns = Rotation.from_matrix(each)
        if float((turns * told.inv()).magnitude().max()) < _AGREE:
            quaternions = np.full((len(block), 4), np.nan)
            quaternions[seen] = turns.as_quat()
            for k, axis in enumerate("XYZW"):
                table.columns[f"{name}.Rotation.{axis}"] = quaternions[:, k]
            return
    table.notes.append(
        f"the matrices of {name} do not agree with its roll, pitch and yaw about the turned x, y and z: turns"
        " are left out"
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
