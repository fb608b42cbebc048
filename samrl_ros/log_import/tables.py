"""Files of other tools as named arrays: CSV with lists in cells, NPZ, MAT of version 5 and 7.3."""

from __future__ import annotations

import io
import re
import subprocess
import sys
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from samrl_core.common.array_file import UNREADABLE, unpacked
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_ros.log_import import mat_reader
from samrl_ros.log_import.specs import CsvOptions

_LONGEST_MAT_S = 120.0  # [s] to read a file
_TEXT = (".csv", ".tsv", ".txt")
_SEPARATORS = re.compile(r"[,;\s]+")
_EMPTY = ["-", "na", "Na", "NAN", "Nan", "none", "NONE", "Null"]  # besides those that pandas knows


@dataclass
class Table:
    """Columns of a file. Text columns stay text until numbers are asked for."""

    path: Path
    columns: dict[str, np.ndarray | pd.Series] = field(default_factory=dict)  # text: a series
    decimal: str = "."

    def numbers(self, name: str, where: str) -> np.ndarray:
        """A column (N,), a list of columns (N, K) or a single number (1,). Missing cells are NaN."""
        cells = self._get(name, where)
        if isinstance(cells, np.ndarray):
            return cells
        if any(str(cell).lstrip().startswith(("[", "(", "{")) for cell in cells.head(10)):
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
        InputError: no such file, another suffix, or a file of another kind than its suffix.
    """
    if not is_file(path):
        raise InputError(f"{where}: no file {path}; --data names the folder that paths count from")
    suffix = path.suffix.lower()
    try:
        if suffix in _TEXT:
            return _read_text(path, options, where)
        if suffix in (".npz", ".npy"):
            return _read_numpy(path)
        if suffix == ".mat":
            return _read_mat(path, where)
    except (*UNREADABLE, pd.errors.ParserWarning, pd.errors.ParserError, NotImplementedError) as error:
        raise InputError(f"{where}: {path} cannot be read as {suffix}: {error}") from error
    raise InputError(
        f"{where}: {path.name} is of unknown kind; use {', '.join((*_TEXT, '.npz', '.npy', '.mat'))}"
    )


def _read_text(path: Path, options: CsvOptions, where: str) -> Table:
    tab = path.suffix.lower() == ".tsv" and options.delimiter == ","
    how: dict[str, Any] = {"sep": "\t" if tab else options.delimiter, "skipinitialspace": True}
    with path.open(newline="", encoding="utf-8-sig") as stream:
        text = "".join(
            line
            for number, line in enumerate(stream)
            if number >= options.skip_lines and not (options.comment and line.startswith(options.comment))
        )
    first = pd.read_csv(io.StringIO(text), header=None, nrows=1, dtype=str, keep_default_na=False, **how)
    names = [str(name).strip() for name in (first.iloc[0] if options.header else first.columns)]
    if double := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(
            f"{where}: {path.name} names columns {double} twice; set header: false and use numbers"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # else cells beyond the header are dropped
        frame = pd.read_csv(
            io.StringIO(text),
            header=0 if options.header else None,
            names=names,
            index_col=False,
            decimal=options.decimal,
            na_values=_EMPTY,
            low_memory=False,  # one type per column, not one per block of rows
            **how,
        )
    columns: dict[str, np.ndarray | pd.Series] = {
        name: frame[name].to_numpy(dtype=float, copy=True)
        if frame[name].dtype.kind in "fi"
        else frame[name].astype("str")
        for name in names
    }
    return Table(path, columns, options.decimal)


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
    # In a process of its own: SciPy's reader ends the whole process on some damaged files (1.18: SIGSEGV).
    command = [sys.executable, "-m", mat_reader.__name__, str(path)]
    try:
        run = subprocess.run(command, capture_output=True, timeout=_LONGEST_MAT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"{where}: {path} took more than {_LONGEST_MAT_S} s to read; save it anew, with -v7"
        ) from error
    if run.returncode:
        lines = run.stderr.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines and run.returncode > 0 else f"its reader died ({run.returncode})"
        raise InputError(f"{where}: {path} cannot be read as .mat: {reason}; save it anew, with -v7")
    return Table(path, {name: _column(v) for name, v in unpacked(run.stdout, path).items()})


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
