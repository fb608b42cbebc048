"""Files of other tools as named arrays: CSV with lists in cells, NPZ, MAT of version 5 and 7.3."""

from __future__ import annotations

import csv
import re
import zipfile
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError

_TEXT = (".csv", ".tsv", ".txt")
_SEPARATORS = re.compile(r"[,;\s]+")
_EMPTY = ("", "nan", "na", "n/a", "null", "none", "-")


@dataclass(frozen=True)
class CsvOptions:
    """How a text file is written."""

    delimiter: str = ","
    header: bool = True  # first line names the columns; else they are called 0, 1, ...
    skip_lines: int = 0  # before the header
    comment: str = ""  # lines that start with it are left out
    decimal: str = "."


@dataclass
class Table:
    """Columns of a file. Text columns are kept as text until somebody asks for numbers."""

    path: Path
    columns: dict[str, Any] = field(default_factory=dict)  # text: list[str]; else array

    def numbers(self, name: str, where: str) -> np.ndarray:
        """A column (N,), a list of columns (N, K) or a single number (1,). Missing cells are NaN."""
        value = self._get(name, where)
        if not isinstance(value, list):
            return value
        if any(cell.lstrip().startswith(("[", "(", "{")) for cell in value[:10]):
            return self._lists(name, value, where)
        numbers = np.empty(len(value))
        for k, cell in enumerate(value):
            try:
                numbers[k] = float(cell)
            except ValueError as error:
                if cell.strip().lower() not in _EMPTY:
                    raise InputError(
                        f"{where}: column {name!r} of {self.path.name}, row {k}: {cell!r} is no number"
                    ) from error
                numbers[k] = np.nan
        return numbers

    def times(self, name: str, where: str) -> np.ndarray:
        """A column of ISO 8601 dates (N,) [s since 1970, UTC where no zone is given]."""
        value = self._get(name, where)
        if not isinstance(value, list):
            raise InputError(f"{where}: column {name!r} of {self.path.name} holds numbers, not ISO dates")
        seconds = np.empty(len(value))
        for k, cell in enumerate(value):
            try:
                moment = datetime.fromisoformat(cell.strip())
            except ValueError as error:
                raise InputError(
                    f"{where}: column {name!r} of {self.path.name}, row {k}: {cell!r} is no ISO 8601 date"
                ) from error
            seconds[k] = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
        return seconds

    def _get(self, name: str, where: str) -> Any:
        if name not in self.columns:
            present = ", ".join(map(repr, self.columns)) or "none"
            raise InputError(f"{where}: {self.path.name} has no column {name!r}; it has {present}")
        return self.columns[name]

    def _lists(self, name: str, cells: list[str], where: str) -> np.ndarray:
        rows: list[list[float]] = []
        width = 0
        for k, cell in enumerate(cells):
            inner = cell.strip().strip("[](){}").strip()
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


def read_table(path: Path, options: CsvOptions, where: str) -> Table:
    """A file as a table, by its suffix: .csv .tsv .txt, .npz .npy, .mat.

    Raises:
        InputError: no such file, another suffix, or a file that is not what its suffix says.
    """
    if not path.is_file():
        raise InputError(f"{where}: no file {path}; --data names the folder that paths count from")
    suffix = path.suffix.lower()
    try:
        if suffix in _TEXT:
            return _read_text(path, options, where)
        if suffix in (".npz", ".npy"):
            return _read_numpy(path)
        if suffix == ".mat":
            return _read_mat(path, where)
    except (OSError, ValueError, UnicodeDecodeError, csv.Error, zipfile.BadZipFile, EOFError) as error:
        raise InputError(f"{where}: {path} cannot be read as {suffix}: {error}") from error
    raise InputError(
        f"{where}: {path.name} is of unknown kind; use {', '.join((*_TEXT, '.npz', '.npy', '.mat'))}"
    )


def _read_text(path: Path, options: CsvOptions, where: str) -> Table:
    delimiter = "\t" if path.suffix.lower() == ".tsv" and options.delimiter == "," else options.delimiter
    with path.open(newline="", encoding="utf-8-sig") as stream:
        lines = (
            line
            for number, line in enumerate(stream)
            if number >= options.skip_lines
            and line.strip()
            and not (options.comment and line.startswith(options.comment))
        )
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    if not rows:
        raise InputError(f"{where}: {path} holds no lines")
    names = (
        [name.strip() for name in rows.pop(0)] if options.header else [str(k) for k in range(len(rows[0]))]
    )
    if len(set(names)) != len(names):
        double = sorted({name for name in names if names.count(name) > 1})
        raise InputError(
            f"{where}: {path.name} names columns {double} twice; set header: false and use numbers"
        )
    for number, row in enumerate(rows):
        if len(row) > len(names):
            raise InputError(
                f"{where}: {path.name}, row {number} has {len(row)} cells, the header {len(names)}; wrong"
                " delimiter?"
            )
        row.extend([""] * (len(names) - len(row)))
    if options.decimal != ".":
        rows = [[cell.replace(options.decimal, ".") for cell in row] for row in rows]
    columns = zip(*rows, strict=True) if rows else ([] for _ in names)
    return Table(path, {name: list(column) for name, column in zip(names, columns, strict=True)})


def _read_numpy(path: Path) -> Table:
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Table(path, {"data": _column(loaded)})
    with loaded:
        found = {name: loaded[name] for name in loaded.files}
    return Table(path, {name: _column(v) for name, v in found.items() if v.dtype.kind in "fiub"})


def _read_mat(path: Path, where: str) -> Table:
    with path.open("rb") as stream:
        head = stream.read(128)
    if b"MATLAB 7.3" in head or head.startswith(b"\x89HDF"):
        return _read_hdf5(path, where)
    from scipy.io import loadmat

    table = Table(path)
    for name, value in loadmat(path, squeeze_me=False, struct_as_record=True).items():
        if not name.startswith("__"):
            _add_mat(table.columns, name, value)
    return table


def _add_mat(columns: dict[str, Any], name: str, value: Any) -> None:
    """Numbers by name; fields of a struct as `name.field`."""
    array = np.asarray(value)
    if array.dtype.names:
        for part in array.dtype.names:
            if array.size == 1:
                _add_mat(columns, f"{name}.{part}", array.ravel()[0][part])
    elif array.dtype.kind in "fiub":
        columns[name] = _column(array)


def _read_hdf5(path: Path, where: str) -> Table:
    try:
        import h5py  # optional
    except ImportError as error:
        raise InputError(
            f"{where}: {path} is a MATLAB 7.3 (HDF5) file; `pip install h5py`, or save it with -v7"
        ) from error
    table = Table(path)

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and not name.startswith("#"):
            table.columns[name.replace("/", ".")] = _column(np.asarray(item).T)  # MATLAB's order is reversed

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return table


def _column(value: np.ndarray) -> np.ndarray:
    """Floats (N,) or (N, K); rows lie along the longer side of a vector."""
    array = np.asarray(value, dtype=float)
    if array.ndim <= 1 or (array.ndim == 2 and 1 in array.shape):
        return array.reshape(-1)
    if array.ndim > 2:
        return array.reshape(len(array), -1)
    return array
