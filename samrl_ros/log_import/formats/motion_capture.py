"""Exports of motion captures, whose columns are named by several rows above the table.

OptiTrack Motive (docs.optitrack.com, Data Export: CSV): a line of keys and values, then rows of types, names,
(since 1.2x) IDs and parents, Rotation or Position, and axes. Vicon Nexus and Tracker: sections, each with its
name, its rate, a row of names, a row of axes and one of units. Empty cells are frames in which something was
not seen. Qualisys' are read in `qualisys.py`.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from samrl_ros.log_import.formats.qualisys import read_qualisys
from samrl_ros.log_import.table import Table

VICON_SECTIONS = ("Objects", "Segments", "Trajectories", "Model Outputs")
_UNITS = {
    "meters": "m", "centimeters": "cm", "millimeters": "mm", "inches": "in", "m": "m", "cm": "cm", "mm": "mm",
    "rad": "rad", "deg": "deg",
}  # fmt: skip
_FIRST_LINES = 12  # within which a file tells what it is


def read_motion_capture(path: Path, lines: Sequence[str]) -> Table | None:
    """The table of an export, columns as `cube.Position.X` or `cube.TX`; None of any other text.

    Args:
        path: of the file.
        lines: its text.
    """
    head = [line.strip().strip('"') for line in lines[:_FIRST_LINES]]
    if head and head[0].replace(";", ",").lower().startswith("format version,"):
        return _read_motive(path, lines)
    if (table := read_qualisys(path, lines)) is not None:
        return table
    for number, line in enumerate(head[:-1]):
        name, rate = line.rstrip(",;"), _number(head[number + 1].rstrip(",;"))
        if name in VICON_SECTIONS and rate is not None and rate > 0:
            return _read_vicon(path, lines, number, rate)
    return None


def _read_motive(path: Path, lines: Sequence[str]) -> Table | None:
    delimiter = ";" if lines[0].count(";") > lines[0].count(",") else ","
    rows = list(csv.reader(lines, delimiter=delimiter))
    about = {rows[0][k].strip(): rows[0][k + 1].strip() for k in range(0, len(rows[0]) - 1, 2)}
    axes_at = next((k for k, row in enumerate(rows) if row and row[0].strip() == "Frame"), 0)
    if not axes_at:
        return None
    axes = [cell.strip() for cell in rows[axes_at]]
    above = [row for row in rows[1:axes_at] if any(cell.strip() for cell in row)]
    labelled = {cells[1].strip(): cells for cells in above if len(cells) > 1 and cells[1].strip()}
    # Before 1.24 rows have no label: they are types, names, (IDs), kinds, in this order.
    types = labelled.get("Type", above[0] if above else [])
    names = labelled.get("Name", above[1] if len(above) > 1 else [])
    kinds = above[-1] if above else []
    euler = about.get("Rotation Type", "Quaternion") != "Quaternion"
    unit = _UNITS.get(about.get("Length Units", "").lower(), "")
    first = next((k for k, cell in enumerate(kinds) if cell.strip()), len(axes))
    titles, units = [], {}
    for k, axis in enumerate(axes):
        name, kind = _cell(names, k), _cell(kinds, k)
        title = axis if k < first else ".".join(part for part in (name, kind, axis) if part)
        if euler and kind == "Rotation":
            title = f"{name}.Euler {about['Rotation Type']}.{axis}"
        if title in titles:  # a marker as measured beside the same as solved
            title = f"{_cell(types, k)} {title}".strip()
        titles.append(title)
        if kind == "Position" and unit:
            units[title] = unit
    table = _as_table(path, titles, rows[axes_at + 1 :])
    table.units, table.maker = units, "Motive"
    stamps = next((t for t in titles if t.startswith("Time (Seconds)")), "")
    if stamps:
        table.time = np.asarray(table.columns[stamps])
    if euler:
        table.notes.append(
            f"rotations are Euler angles {about['Rotation Type']}: export quaternions to have them used"
        )
    return table


def _read_vicon(path: Path, lines: Sequence[str], number: int, rate: float) -> Table | None:
    """The first section that holds poses or points."""
    delimiter = ";" if lines[number + 3].count(";") > lines[number + 3].count(",") else ","
    section = []
    for line in lines[number + 2 :]:
        if not line.strip().strip(",;"):
            break  # an empty line ends it
        section.append(line)
    rows = list(csv.reader(section, delimiter=delimiter))
    if len(rows) < 3 or _cell(rows[1], 0) != "Frame":
        return None
    titles, units, name = [], {}, ""
    for k, axis in enumerate(cell.strip() for cell in rows[1]):
        name = _cell(rows[0], k) or name
        title = f"{name}.{axis}" if name else axis
        while title in titles:
            title += "_"
        titles.append(title)
        if (unit := _UNITS.get(_cell(rows[2], k).lower(), "")) and name:
            units[title] = unit
    table = _as_table(path, titles, rows[3:], "," if delimiter == ";" else ".")
    table.units, table.maker = units, "Vicon"
    # Frames count from 1, at the trigger: beside another device the chain was a frame off.
    table.time = (np.asarray(table.columns["Frame"]) - 1.0) / rate
    return table


def _as_table(path: Path, titles: list[str], rows: Sequence[Sequence[str]], decimal: str = ".") -> Table:
    """Columns of numbers; cells that are none are NaN. Rows without a frame are left out."""
    kept = [row for row in rows if row and _number(row[0]) is not None]
    width = len(titles)
    cells = np.full((len(kept), width), np.nan)
    for i, row in enumerate(kept):
        for k, cell in enumerate(row[:width]):
            value = _number(cell.replace(decimal, ".") if decimal != "." else cell)
            cells[i, k] = np.nan if value is None else value
    named = {title: cells[:, k].copy() for k, title in enumerate(titles) if title}
    return Table(path, {title: values for title, values in named.items() if np.isfinite(values).any()})


def _cell(row: Sequence[str], k: int) -> str:
    return row[k].strip() if k < len(row) else ""


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
