"""Lines that repeat each column's name before its number, as Arduino's Serial Plotter reads them.

`t_ms:0.0,theta_deg:-0.1` or `t=0.1 pos=0.5`: cells are parted by a comma, a tab or blanks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from samrl_core.common.errors import InputError
from samrl_ros.log_import.table import NUMBER

Mark = Literal[":", "="]
MARKS: tuple[Mark, ...] = (":", "=")
_DELIMITERS = (",", ";", "\t", " ")
_NAME = re.compile(r"[^\W\d][^\"'{}]*|[/_][^\"'{}]+")  # no time of day, no JSON
_NUMBER = re.compile(NUMBER, re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_FEW = 3  # rows that show how a file is written


@dataclass(frozen=True)
class PairLayout:
    """How such lines are written."""

    mark: Mark  # between a name and its number
    delimiter: str  # a blank: any white space
    decimal: str
    first: int  # line, from 0, at which the rows begin


def find_pairs(lines: Sequence[str]) -> PairLayout | None:
    """How lines of names and numbers are written; None where most of them are no such lines.

    Titles are passed over, and a first row that was cut at its front: a port was opened amid the line.
    """
    filled = [k for k, line in enumerate(lines) if line.strip()]
    for mark in MARKS:
        for delimiter in _DELIMITERS:
            rows = {k: cells for k in filled if (cells := _split(lines[k], mark, delimiter))}
            names = {k: [name for name, _ in cells] for k, cells in rows.items()}
            usual = max(map(tuple, names.values()), key=list(map(tuple, names.values())).count, default=())
            own = [k for k in names if tuple(names[k]) == usual]
            values = [value for k in own for _, value in rows[k]]
            decimal = "," if any(map(_DECIMAL_COMMA.fullmatch, values)) else "."
            numbers = sum(is_number(value, decimal) for value in values)
            if len(usual) < 2 or len(own) < _FEW or 2 * len(own) <= len(filled) or 2 * numbers <= len(values):
                continue
            first = next(k for k in names if len(names[k]) > 1 and not _is_rest(names[k], usual))
            return PairLayout(mark, delimiter, decimal, first)
    return None


def part_names(
    lines: Iterable[tuple[int, str]], mark: str, delimiter: str, decimal: str, path: Path, where: str
) -> tuple[list[str], list[list[str]], list[str]]:
    """Names of the first line, values of each, and what is odd about them.

    A last line that ends before its last name or number is left out.

    Args:
        lines: numbers, from 1, and texts of lines.
        mark: between a name and its number.
        delimiter: between cells; a blank is any white space.
        decimal: mark of numbers.
        path: of the file, for messages.
        where: key path, for messages.

    Raises:
        InputError: a line with other names than the first, or a value that is no number in a column of them.
    """
    filled = [(number, line) for number, line in lines if line.strip()]
    names: list[str] = []
    rows: list[list[str]] = []
    numeric: dict[str, bool] = {}  # columns, by their first value
    notes: list[str] = []
    for number, line in filled:
        cells = _split(line, mark, delimiter)
        own = [name for name, _ in cells]
        if not names and cells:
            names = own
        if own != names or not cells:
            if rows and number == filled[-1][0] and _is_cut(line, names, mark, delimiter):
                notes.append(f"line {number}, the last of {path.name}, is cut short and left out")
                break
            raise InputError(
                f"{where}: line {number} of {path.name} is {line.strip()[:80]!r}, must be"
                f" {_shown(names, mark, delimiter)} as the first one is; correct or delete that line, or pass"
                " over lines above the table by `csv.skip_lines`"
            )
        values = [value for _, value in cells]
        for name, value in cells:
            if value and numeric.setdefault(name, is_number(value, decimal)) > is_number(value, decimal):
                raise InputError(
                    f"{where}: line {number} of {path.name} has {name!r} {value[:40]!r}, must be a number as"
                    " above it; correct or delete that line, or leave the value empty and set"
                    " `missing`"
                )
        rows.append(values)
    return names, rows, notes


def is_number(text: str, decimal: str) -> bool:
    """Whether a text is one, written with this decimal mark or without one."""
    return bool(_NUMBER.fullmatch(text) or (decimal == "," and _DECIMAL_COMMA.fullmatch(text)))


def _split(line: str, mark: str, delimiter: str) -> list[tuple[str, str]]:
    """Names and values of a line; empty where any of its cells is no such pair."""
    pairs = []
    for cell in _cells(line, mark, delimiter):
        name, between, value = (part.strip() for part in cell.partition(mark))
        if not between or not _NAME.fullmatch(name):
            return []
        pairs.append((name, value))
    return pairs


def _cells(line: str, mark: str, delimiter: str) -> list[str]:
    """Cells of a line, without an empty one that a delimiter at its end leaves."""
    line = line.strip()
    if delimiter == " ":  # of `t: 0.1 pos: 0.5` each mark belongs to the name before it
        return re.sub(rf"[^\S\r\n]*{re.escape(mark)}[^\S\r\n]*(?=[-+.\w])", mark, line).split()
    return line.removesuffix(delimiter).split(delimiter)


def _is_rest(names: Sequence[str], whole: Sequence[str]) -> bool:
    """Whether names are the last ones of a row, the first of them perhaps without its first letters."""
    count = len(names)
    behind = list(whole[len(whole) - count :])
    cut = count < len(whole) or names[0] != whole[0]
    return cut and count <= len(whole) and list(names[1:]) == behind[1:] and behind[0].endswith(names[0])


def _is_cut(line: str, names: Sequence[str], mark: str, delimiter: str) -> bool:
    """Whether a line is the beginning of a row with these names."""
    cells = _cells(line, mark, delimiter)
    begun = [cell.partition(mark)[0].strip() for cell in cells]
    count = len(begun)
    return 0 < count <= len(names) and begun[:-1] == list(names[: count - 1]) and (
        names[count - 1].startswith(begun[-1])
    )  # fmt: skip


def _shown(names: Sequence[str], mark: str, delimiter: str) -> str:
    if not names:
        return f"NAME{mark}NUMBER in each cell"
    return repr(delimiter.join(f"{name}{mark}..." for name in names[:4]) + (" ..." if names[4:] else ""))
