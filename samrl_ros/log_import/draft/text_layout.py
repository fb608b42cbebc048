"""How a text file is written: its delimiter, comments, lines above the table, and the names of its columns.

A file that reads as a comma-separated table with one header keeps the defaults, so that nothing is stated
that a reader would take for a peculiarity.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.echoed_messages import echoed_names
from samrl_ros.log_import.formats.encoding import decoded_text
from samrl_ros.log_import.formats.header_lines import count_name_lines, repeated_key
from samrl_ros.log_import.formats.name_value import find_pairs
from samrl_ros.log_import.formats.text import is_known_export
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import NUMBER, is_list_of_numbers
from samrl_ros.log_import.tables import is_text_table

_HEAD = 60  # lines that are looked at
_COMMENTS = ("#", "%", "//")
_DELIMITERS = (",", ";", "\t", " ")
_NUMBER = re.compile(NUMBER, re.IGNORECASE)
_UNIT_KEYS = frozenset("unit units".split())
_TYPES = frozenset(
    "double single float float32 float64 int int32 int64 uint8 uint16 uint32 bool boolean".split()
)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_ENOUGH = 0.5  # of a row's cells that are numbers
_FEW = 3  # rows that show how a file is written


def text_options(path: Path) -> CsvOptions:
    """How to read a file; the defaults of any file that is no text, and of one that they fit.

    Raises:
        InputError: the file cannot be read, or its line of names does not fit its rows.
    """
    if not is_text_table(path):
        return CsvOptions()
    try:
        stream = io.StringIO(decoded_text(path), newline="")
        text = list(islice(stream, _HEAD))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the path") from error
    except ValueError as error:
        raise InputError(f"{path} cannot be read as text: {error}") from error
    if is_known_export(path, text):
        return CsvOptions()
    lines = [line.rstrip("\r\n") for line in text]
    tab = path.suffix.lower() == ".tsv"
    try:
        return _options(lines, tab) or CsvOptions()
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from None


def stated_options(options: CsvOptions) -> dict[str, Any]:
    """What a mapping states of them: all that differs from the defaults."""
    return options.model_dump(exclude_defaults=True)


def _options(lines: Sequence[str], tab: bool) -> CsvOptions | None:
    """None where no table of numbers is found.

    Raises:
        InputError: the line of names has more or fewer cells than the rows below it.
    """
    filled = [line.strip() for line in lines if line.strip()]
    if len(filled) >= _FEW and all(map(_NUMBER.fullmatch, filled)):
        return CsvOptions(header=False)  # one column, without a name
    if (pairs := find_pairs(lines)) is not None:
        plain = "," if tab and pairs.delimiter == "\t" else pairs.delimiter
        return CsvOptions(delimiter=plain, decimal=pairs.decimal, pairs=pairs.mark, skip_lines=pairs.first)
    if (named := _named_in_rows(lines)) is not None:
        return named
    best: tuple[tuple[bool, int, int], str, str] | None = None
    for delimiter in _DELIMITERS:
        for decimal in (".", ","):
            if decimal == delimiter and not any('"' in line for line in lines):
                continue  # in quotes a cell may hold what parts cells: "0,25","1,5"
            width = _width(lines, delimiter, decimal)
            # Of rows such as `0,1;2;3` most cells are numbers with a point, too: all are with a comma. Of
            # `0.1,1 2 3` most of what blanks part are numbers, too: all of what commas part are, or lists.
            listed = delimiter != " " and _holds_lists(lines, delimiter, width)
            rank = listed, width, sum(_count_numbers(line, delimiter, decimal) for line in lines)
            if width > 1 and (best is None or rank > best[0]):
                best = rank, delimiter, decimal
    if best is None:
        return None
    (_, width, _), delimiter, decimal = best
    comment = next((c for c in _COMMENTS if lines[0].startswith(c)), "")
    begin = next(k for k, line in enumerate(lines) if _is_data(line, delimiter, decimal, width))
    above = [k for k in range(begin) if lines[k].strip()]
    if (count := _lines_of_names(lines[:begin], delimiter, width)) and not _names_of_pairs(
        [lines[k] for k in above[-2:]], delimiter, width
    ):
        written = "," if tab and delimiter == "\t" else delimiter
        return CsvOptions(delimiter=written, decimal=decimal, header_lines=count, skip_lines=begin - count)
    names: list[str] = []
    for k in reversed(above):
        cells = _split(lines[k].lstrip("#%/ "), delimiter)
        if repeated_key(cells):
            continue
        if len(cells) == width and any(cells) and len(set(cells)) == width:
            names = [cell.strip().strip('"') for cell in cells]
            break
        if comment and (named := _words_of_comment(lines[k], width)):
            names = named
            break
    own = [line for line in lines[begin:] if _is_data(line, delimiter, decimal, width)]
    again = [] if names or not above else (
        _names_of_pairs([lines[k] for k in above[-2:]], delimiter, width)
        or _mended_names(lines[above[-1]], own, delimiter, width)
    )  # fmt: skip
    plain = delimiter == ("\t" if tab else ",") and decimal == "."
    how: dict[str, Any] = {"delimiter": "," if tab and delimiter == "\t" else delimiter, "decimal": decimal}
    if comment:
        how["comment"] = comment[:1]
    if again:
        return CsvOptions(**how, header=again, skip_lines=begin)
    if not names and _cells(lines[begin], delimiter) == [str(k) for k in range(width)]:
        # The numbers of columns, as pandas writes them where they have no names.
        return None if plain and begin == 0 else CsvOptions(**how, skip_lines=0 if comment else begin)
    if not names and not above and (named := echoed_names([_cells(row, delimiter) for row in own])):
        return CsvOptions(**how, header=named)
    counted = all(_NUMBER.fullmatch(lines[k].strip()) for k in above)  # by the number of matrices, or nothing
    if not names and counted and _are_matrices(own, delimiter):
        return CsvOptions(**how, header=False, rows_per_sample=4, skip_lines=begin if above else 0)
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


def _lines_of_names(above: Sequence[str], delimiter: str, width: int) -> int:
    """How many lines of names stand right above a table, of groups and of what is in them; else 0."""
    if delimiter == " " or any(line.lstrip().startswith(_COMMENTS) for line in above):
        return 0
    return count_name_lines([_cells(line, delimiter) for line in above], width)


def _named_in_rows(lines: Sequence[str]) -> CsvOptions | None:
    """Rows that repeat each name before its number, `t,12,PWM,0`; None where they are no such rows."""
    for delimiter in _DELIMITERS:
        rows = [_cells(line, delimiter) for line in lines]
        told = [k for k, cells in enumerate(rows) if len(cells) > 3 and _takes_turns(cells)]
        if len(told) < _FEW or told != list(range(told[0], told[0] + len(told))):
            continue
        names = rows[told[0]][::2]
        if len({tuple(rows[k][::2]) for k in told}) == 1 and len(set(names)) == len(names):
            header = [part for name in names for part in (f"({name})", name)]
            return CsvOptions(delimiter=delimiter, header=header, skip_lines=told[0])
    return None


def _are_matrices(rows: Sequence[str], delimiter: str) -> bool:
    """Whether every fourth of rows of four numbers is 0 0 0 1: homogeneous matrices below each other."""
    cells = [_cells(row, delimiter) for row in rows]
    if len(rows) < 4 * _FEW or any(len(row) != 4 for row in cells):
        return False
    last = [
        all(_NUMBER.fullmatch(x) for x in row) and [float(x) for x in row] == [0, 0, 0, 1] for row in cells
    ]
    return all(is_last == (k % 4 == 3) for k, is_last in enumerate(last))


def _takes_turns(cells: Sequence[str]) -> bool:
    """Whether every other cell is a name, and every other one a number."""
    words = all(cell and not _NUMBER.fullmatch(cell) for cell in cells[::2])
    return len(cells) % 2 == 0 and words and all(_NUMBER.fullmatch(cell) for cell in cells[1::2])


def _names_of_pairs(above: Sequence[str], delimiter: str, width: int) -> list[str]:
    """Names that span two columns each, over `X,Y,X,Y`, as software of drives exports traces; else empty."""
    if len(above) < 2 or delimiter == " ":
        return []
    names, axes = (_cells(line, delimiter) for line in above)
    whole = len(axes) == width and axes[: width // 2 * 2] == axes[:2] * (width // 2) and axes[0] != axes[1]
    if not whole or width % 2 or not all(names[: width - 1 : 2]) or any(names[1:width:2]):
        return []
    return [f"{names[k // 2 * 2]} {axis} ({k // 2 + 1})" for k, axis in enumerate(axes)]


def _mended_names(line: str, rows: Sequence[str], delimiter: str, width: int) -> list[str]:
    """Names above rows that do not fit them at once; empty where the line holds no names.

    A name that stands twice is counted; cells that are empty in every row, or behind the last name, are what
    a delimiter at the end of a line leaves.

    Raises:
        InputError: another number of names than cells, and no way to tell whose they are.
    """
    cells = [cell.strip().strip('"') for cell in _split(line.lstrip("#%/ "), delimiter)]
    if len(cells) < 2 or delimiter == " " or sum(bool(_NUMBER.fullmatch(cell)) for cell in cells) > 1:
        return []
    if len(cells) == width + 1 and not cells[-1]:
        cells = cells[:-1]
    if len(cells) == width - 1 and all(not _cells(row, delimiter)[-1] for row in rows):
        cells = [*cells, "(empty)"]
    if len(cells) != width:
        if len(cells) < _ENOUGH * width:
            return []  # a title
        raise InputError(
            f"the line of names has {len(cells)} ({', '.join(cells[:3])}, ...), the rows below it hold"
            f" {width} numbers: which number has which name is open. Correct that line, or list them in a"
            f" mapping as csv: {{header: [...], skip_lines: ...}}, {width} of them"
        )
    return [
        f"{cell} ({cells[:k].count(cell) + 1})" if cell in cells[:k] else cell for k, cell in enumerate(cells)
    ]


def _units_row(between: Sequence[str], delimiter: str, width: int) -> list[str]:
    """Units that stand in a row of their own between the names and the data; empty where there is none.

    Simulink's Data Inspector writes rows of `Type: double`, `Unit: deg` and more: each cell repeats its key.
    """
    for line in between:
        cells = [cell.strip().strip('"[]()') for cell in _split(line, delimiter)]
        filled = [cell for cell in cells if cell]
        if len(cells) != width or not filled or any(map(_NUMBER.fullmatch, filled)):
            continue
        if key := repeated_key(cells):
            if key.lower() in _UNIT_KEYS:
                return [cell.partition(": ")[2].strip() for cell in cells]
        elif not _TYPES.issuperset(filled):
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
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])


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
        if _NUMBER.fullmatch(cell)
        or (decimal == "," and _DECIMAL_COMMA.fullmatch(cell))
        or (delimiter != " " and is_list_of_numbers(cell))
    )


def _holds_lists(lines: Sequence[str], delimiter: str, width: int) -> bool:
    """Whether each row is numbers and some lists of them, with blanks between, as `0.1,1 2 3,0 0 0 1`."""
    rows = [_cells(line, delimiter) for line in lines if _is_data(line, delimiter, ".", width)]
    lists = [sum(map(is_list_of_numbers, row)) for row in rows]
    numbers = [sum(bool(_NUMBER.fullmatch(cell)) for cell in row) for row in rows]
    return bool(rows) and all(lists) and all(
        a + b == len(row) for a, b, row in zip(lists, numbers, rows, strict=True)
    )  # fmt: skip


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"') for cell in _split(line, delimiter)]
