"""Named columns of one file or one of its parts, as numbers when somebody asks for them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError

WIDEST = 1024  # numbers of one sample that are read; more is an image, no signal
NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)"
SPACED = re.compile(rf"(?:{NUMBER})(?:[ ;]+(?:{NUMBER})){{2,}}", re.IGNORECASE)  # `0.1 0.2 0.3` in one cell
_NUMBER = re.compile(NUMBER, re.IGNORECASE)
_SEPARATORS = re.compile(r"[,;\s]+")
# What Python's csv writes of a message's list, `array('d', [0.1, 0.2])` or `array('d')`, and of NumPy's.
_ARRAY = re.compile(  # no two runs of blanks beside each other: a long one would be parted in every way
    r"""(?:\w+\.)?array\(\s*(?:(['"])\w\1(?:\s*,)?\s*)?(?:([\[(].*[\])])\s*)?(?:,\s*dtype=[^,]*)?\)""",
    re.DOTALL,
)


def list_in(cell: str) -> str | None:
    """What stands between the brackets of a cell that is a list, `[0.1, 0.2]`; None of any other cell."""
    inner = cell.strip()
    if array := _ARRAY.fullmatch(inner):
        inner = array[2] or "[]"
    return inner.strip("[](){}").strip() if inner.startswith(("[", "(", "{")) else None


def _is_list(cell: str) -> bool:
    """Whether a cell holds several numbers: in brackets, or three and more with blanks between."""
    return list_in(cell) is not None or bool(SPACED.fullmatch(cell.strip()))


def is_list_of_numbers(cell: str) -> bool:
    """Whether a cell is a whole list of numbers: in brackets, or three and more with blanks between."""
    inner = list_in(cell) if cell.rstrip().endswith(("]", ")", "}")) else None
    words = _SEPARATORS.split(inner) if inner else []
    return inner == "" or bool(words and all(map(_NUMBER.fullmatch, words))) or bool(SPACED.fullmatch(cell))


@dataclass
class Table:
    """Columns of a file. Text columns stay text until numbers are asked for."""

    path: Path
    columns: dict[str, np.ndarray | pd.Series] = field(default_factory=dict)  # text: a series
    decimal: str = "."
    time: np.ndarray | None = None  # (N,) [s] that the file itself gives its rows, if it does
    notes: list[str] = field(default_factory=list)  # what is odd about the file
    units: dict[str, str] = field(default_factory=dict)  # of columns, where the file states them
    maker: str = ""  # whose layout it is, where that is known

    def numbers(self, name: str, where: str) -> np.ndarray:
        """A column (N,), a list of columns (N, K) or a single number (1,). Missing cells are NaN."""
        cells = self._get(name, where)
        if isinstance(cells, np.ndarray):
            return cells
        if any(_is_list(str(cell)) for cell in cells.head(10)):
            return self._lists(name, cells, where)
        numbers = pd.Series(pd.to_numeric(cells, errors="coerce"))
        self._refuse(name, cells, numbers, where, "number")
        return np.array(numbers, dtype=float)  # a copy: pandas' own are read-only

    def times(self, name: str, where: str) -> np.ndarray:
        """A column of ISO 8601 dates (N,) [s since 1970, UTC where no zone is given]."""
        cells = self._get(name, where)
        if isinstance(cells, np.ndarray):
            raise InputError(f"{where}: column {name!r} of {self.path.name} holds numbers, not ISO dates")
        moments = pd.Series(pd.to_datetime(cells, format="ISO8601", utc=True, errors="coerce"))
        self._refuse(name, cells.fillna(""), moments, where, "ISO 8601 date")
        return moments.astype("datetime64[us, UTC]").astype("int64").to_numpy() / 1e6

    def _get(self, name: str, where: str) -> np.ndarray | pd.Series:
        if name not in self.columns:
            present = ", ".join(map(repr, self.columns)) or "none"
            raise InputError(f"{where}: {self.path.name} has no column {name!r}; it has {present}")
        return self.columns[name]

    def _refuse(self, name: str, cells: pd.Series, read: pd.Series, where: str, kind: str) -> None:
        """Raises `InputError` for the first cell that holds something and could not be read."""
        bad = np.flatnonzero(cells.notna() & read.isna())
        if len(bad):
            cell = f"row {bad[0]}: {cells.iloc[bad[0]]!r}"
            raise InputError(f"{where}: column {name!r} of {self.path.name}, {cell} is no {kind}")

    def _lists(self, name: str, cells: pd.Series, where: str) -> np.ndarray:
        rows: list[list[float]] = []
        width = 0
        for k, cell in enumerate(cells.fillna("").str.replace(self.decimal, ".").tolist()):
            listed = list_in(cell)
            inner = cell.strip() if listed is None else listed
            try:
                row = [float(word) for word in _SEPARATORS.split(inner)] if inner else []
            except ValueError as error:
                raise InputError(
                    f"{where}: column {name!r} of {self.path.name}, row {k}: {cell!r} is no list of numbers"
                ) from error
            width = width or len(row)
            if row and len(row) != width:
                raise InputError(
                    f"{where}: column {name!r} of {self.path.name}, row {k} has {len(row)} numbers, others"
                    f" {width}"
                )
            rows.append(row)
        return np.array([row or [np.nan] * width for row in rows])


def rows_as_column(rows: Sequence[Any]) -> np.ndarray | None:
    """Numbers, or lists of numbers, one per row: (N,) or (N, K). A row of None is NaN.

    None where the rows are no numbers, or lists of different length.
    """
    width = max((len(row) for row in rows if isinstance(row, list | np.ndarray)), default=0)
    blank: Any = np.full(width, np.nan) if width else np.nan
    try:
        array = np.array([blank if row is None else row for row in rows], dtype=float)
    except (TypeError, ValueError):
        return None
    return array.reshape(len(array), -1) if array.ndim > 2 else array


def as_column(value: np.ndarray) -> np.ndarray:
    """Floats (N,) or (N, K); rows lie along the longer side of a vector.

    A stack of matrices is one sample per row, row by row; MATLAB stacks along the last axis, and Simulink's
    To Workspace gives a vector of J signals as (J, 1, N).
    """
    array = np.asarray(value, dtype=float)
    if array.ndim == 3 and array.shape[0] in (3, 4) and array.shape[1] <= 4 < array.shape[2]:
        array = np.moveaxis(array, 2, 0)
    elif array.ndim == 3 and array.shape[1] == 1 and array.shape[0] < array.shape[2]:
        array = array[:, 0, :].T
    if array.ndim <= 1 or (array.ndim == 2 and 1 in array.shape):
        return array.reshape(-1)
    if array.ndim > 2:
        return array.reshape(len(array), -1)
    return array
