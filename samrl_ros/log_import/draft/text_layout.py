"""How a text file is written: its delimiter, comments, lines above the table, and the names of its columns.

A file that reads as a comma-separated table with one header keeps the defaults, so that nothing is stated
that a reader would take for a peculiarity.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats.encoding import decoded_text
from samrl_ros.log_import.formats.motion_capture import read_motion_capture
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import TEXT_SUFFIXES

_HEAD = 60  # lines that are looked at
_COMMENTS = ("#", "%", "//")
_DELIMITERS = (",", ";", "\t", " ")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_ENOUGH = 0.5  # of a row's cells that are numbers


def text_options(path: Path) -> CsvOptions:
    """How to read a file; the defaults of any file that is no text, and of one that they fit.

    Raises:
        InputError: the file cannot be read.
    """
    if path.suffix.lower() not in TEXT_SUFFIXES:
        return CsvOptions()
    try:
        stream = io.StringIO(decoded_text(path), newline="")
        lines = [line.rstrip("\r\n") for line in islice(stream, _HEAD)]
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as text: {error}") from error
    if read_motion_capture(path, lines) is not None:
        return CsvOptions()
    tab = path.suffix.lower() == ".tsv"
    return _options(lines, tab) or CsvOptions()


def stated_options(options: CsvOptions) -> dict[str, Any]:
    """What a mapping states of them: all that differs from the defaults."""
    return options.model_dump(exclude_defaults=True)


def _options(lines: Sequence[str], tab: bool) -> CsvOptions | None:
    """None where no table of numbers is found."""
    best: tuple[tuple[int, int], str, str] | None = None
    for delimiter in _DELIMITERS:
        for decimal in (".", ","):
            if decimal == delimiter:
                continue
            width = _width(lines, delimiter, decimal)
            # Of rows such as `0,1;2;3` most cells are numbers with a point, too: all are with a comma.
            rank = width, sum(_count_numbers(line, delimiter, decimal) for line in lines)
            if width > 1 and (best is None or rank > best[0]):
                best = rank, delimiter, decimal
    if best is None:
        return None
    (width, _), delimiter, decimal = best
    comment = next((c for c in _COMMENTS if lines[0].startswith(c)), "")
    begin = next(k for k, line in enumerate(lines) if _is_data(line, delimiter, decimal, width))
    above = [k for k in range(begin) if lines[k].strip()]
    names: list[str] = []
    for k in reversed(above):
        cells = _split(lines[k].lstrip("#%/ "), delimiter)
        if len(cells) == width and any(cells) and len(set(cells)) == width:
            names = [cell.strip().strip('"') for cell in cells]
            break
        if comment and (named := _words_of_comment(lines[k], width)):
            names = named
            break
    plain = delimiter == ("\t" if tab else ",") and decimal == "."
    how: dict[str, Any] = {"delimiter": "," if tab and delimiter == "\t" else delimiter, "decimal": decimal}
    if comment:
        how["comment"] = comment[:1]
    if not names:
        return CsvOptions(**how, header=False, skip_lines=0 if comment or not above else begin)
    header_at = next(k for k in reversed(above) if _named_by(lines[k], delimiter, names, width))
    if plain and header_at == 0 and begin == 1:
        return None  # as any comma-separated table
    if comment or begin > header_at + 1:
        units = _units_row(lines[header_at + 1 : begin], delimiter, width)
        names = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
        # Lines of a comment are passed over anyway; names that stand in none would be a row of data.
        plain_names = not lines[header_at].lstrip().startswith(_COMMENTS)
        return CsvOptions(**how, header=names, skip_lines=begin if plain_names or not comment else 0)
    return CsvOptions(**how, skip_lines=header_at)


def _units_row(between: Sequence[str], delimiter: str, width: int) -> list[str]:
    """Units that stand in a row of their own between the names and the data; empty where there is none."""
    for line in between:
        cells = [cell.strip().strip('"[]()') for cell in _split(line, delimiter)]
        if len(cells) == width and any(cells) and not any(_NUMBER.fullmatch(cell) for cell in cells):
            return cells
    return [""] * width


def _named_by(line: str, delimiter: str, names: Sequence[str], width: int) -> bool:
    cells = [cell.strip().strip('"') for cell in _split(line.lstrip("#%/ "), delimiter)]
    return cells == list(names) or _words_of_comment(line, width) == list(names)


def _words_of_comment(line: str, width: int) -> list[str]:
    """Names in a comment that are parted otherwise than the data; empty where they are not as many."""
    inner = line.lstrip("#%/ ").strip()
    for parted in (re.split(r"\s*,\s*", inner), inner.split()):
        if len(parted) == width and len(set(parted)) == width:
            return [part.strip('"') for part in parted]
    return []


def _split(line: str, delimiter: str) -> list[str]:
    return line.split() if delimiter == " " else line.split(delimiter)


def _width(lines: Sequence[str], delimiter: str, decimal: str) -> int:
    """Cells of the last lines, where at least two of them are data of one width; else 0."""
    widths = [len(_split(line, delimiter)) for line in lines if _is_data(line, delimiter, decimal, 0)]
    return widths[-1] if len(widths) > 1 and len(set(widths[len(widths) // 2 :])) == 1 else 0


def _is_data(line: str, delimiter: str, decimal: str, width: int) -> bool:
    """Whether a line is a row of the table: half of what its cells hold are numbers."""
    if not line.strip() or line.lstrip().startswith(_COMMENTS):
        return False
    cells = _cells(line, delimiter)
    if (width and len(cells) != width) or len(cells) < 2:
        return False
    filled = [cell for cell in cells if cell]
    if decimal == "," and not any(_DECIMAL_COMMA.fullmatch(cell) for cell in filled):
        return False
    return bool(filled) and _count_numbers(line, delimiter, decimal) > _ENOUGH * len(filled)


def _count_numbers(line: str, delimiter: str, decimal: str) -> int:
    """Cells of a line that are numbers, written with this decimal mark or without one."""
    return sum(
        1
        for cell in _cells(line, delimiter)
        if _NUMBER.fullmatch(cell) or (decimal == "," and _DECIMAL_COMMA.fullmatch(cell))
    )


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"') for cell in _split(line, delimiter)]
