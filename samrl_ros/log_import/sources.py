"""One source of a mapping: its files read, rows without values dealt with, intermediate values computed."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file, is_folder
from samrl_ros.log_import.formats.depth_images import read_depth_images
from samrl_ros.log_import.formats.views import files_of_views, is_of_views
from samrl_ros.log_import.formulas import evaluate, names_in
from samrl_ros.log_import.joint_rows import join_samples
from samrl_ros.log_import.specs import ColumnSpec, LoggedSpec, Missing, TimeSpec, source_of_quantity
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table
from samrl_ros.log_import.units import factor

_ONE_OF_ARRAY = re.compile(r"(.+)\[(\d+)\]")
TIME = "time"  # [s] of the source's rows in formulas, unless a column has that name


@dataclass(frozen=True, eq=False)
class SourceData:
    """What formulas of a channel can use."""

    files: tuple[Path, ...]
    time: np.ndarray  # (N,) [s], increasing
    values: dict[str, Any]  # constants, columns (N,) or (N, K), intermediate values


def read_source(
    spec: LoggedSpec,
    name: str,
    constants: dict[str, Any],
    data: Path,
    notes: list[str],
    untimed: bool = False,
) -> SourceData:
    """Read a source; `untimed` numbers the rows where neither mapping nor file gives them a time.

    Raises:
        InputError: naming key path, file, column and row.
    """
    source, where = spec.sources[name], f"{spec.path}.sources.{name}"
    paths = tuple(data / file for file in spec.files_of(name))
    tables = [
        read_table(path, source.csv, f"{where}.file", spec.part_of(name))
        if source.images is None
        else read_depth_images(path, source.images, f"{where}.file")
        for path in paths
    ]
    if source.joint_column:
        tables = [join_samples(t, source.joint_column, f"{where}.joint_column") for t in tables]
    for table in tables:
        notes += [f"{where}: {note}" for note in table.notes]
    columns = {
        key: _column(tables[source.columns[key].file], source.columns[key], f"{where}.columns.{key}")
        for key in sorted(_used(spec, name, constants))
    }
    count = _count(columns, where)
    timed = not untimed or source.time is not None or tables[0].time is not None
    time = _time(source.time, tables[0], count, f"{where}.time") if timed else np.arange(float(count))
    if len(time) != count:
        raise InputError(f"{where}.time has {len(time)} samples, the columns {count}")
    keep = _rows(spec, count)
    if keep.sum() < 2:
        raise InputError(f"{spec.path}.rows {spec.rows} leaves {keep.sum()} of {count} rows")
    bad_time = keep & ~np.isfinite(time)
    if bad_time.any():
        raise InputError(f"{where}.time: row {int(np.flatnonzero(bad_time)[0])} has no time")
    for key, values in columns.items():
        rule = source.columns[key].missing or source.missing
        if rule == "drop_cell" and not untimed:
            raise InputError(
                f"{where}.columns.{key}: `missing: drop_cell` is for trials of a depth side by side; use"
                " drop_row, hold or linear"
            )
        keep &= _fill(values, rule, time, keep, f"{where}.columns.{key}", notes)
    if source.time is not None and source.time.repeated == "drop":
        keep = _without_repeated(time, keep, where, notes)
    _check_increasing(time, keep, where)
    time = time[keep]
    values = {
        TIME: time,
        **constants,
        **{key: v if v.shape == (1,) else v[keep] for key, v in columns.items()},
    }
    for key, formula in source.values.items():
        values[key] = evaluate(formula, values, f"{where}.values.{key}")
    return SourceData(paths, time, values)


def _without_repeated(time: np.ndarray, keep: np.ndarray, where: str, notes: list[str]) -> np.ndarray:
    """Rows (N,) to keep, without those whose time is none after all before."""
    ahead = np.maximum.accumulate(np.where(keep, time, -np.inf))
    repeated = keep & (time <= np.concatenate([[-np.inf], ahead[:-1]]))
    if repeated.any():
        notes.append(f"{where}: {repeated.sum()} rows whose time does not increase are left out")
    return keep & ~repeated


def _check_increasing(time: np.ndarray, keep: np.ndarray, where: str) -> None:
    rows, kept = np.flatnonzero(keep), time[keep]
    steps = np.flatnonzero(np.diff(kept) <= 0)
    if len(steps):
        k = int(steps[0])
        raise InputError(
            f"{where}.time: goes from {kept[k]:.6f} to {kept[k + 1]:.6f} s at row {int(rows[k + 1])}"
            f" ({len(steps)} such steps); `repeated: drop` leaves such rows out, `rows` cuts the log"
        )


def update_digest(digest: hashlib._Hash, path: Path) -> None:
    """Adds a file's content; of a folder (a bag, a dataset) all of its files in the order of their names."""
    files = sorted(p for p in path.rglob("*") if is_file(p)) if is_folder(path) else [path]
    if is_of_views(path):
        files = [file for _, file in files_of_views(path)]
    for file in files:
        with file.open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)


def _used(spec: LoggedSpec, name: str, constants: dict[str, Any]) -> set[str]:
    """Columns that some formula needs; others may be broken without harm."""
    source, path = spec.sources[name], f"{spec.path}.sources.{name}"
    known = {TIME} | set(constants) | set(source.columns) | set(source.values)
    wanted: set[str] = set()

    def want(formula: str | float, where: str) -> None:
        names = names_in(formula, where)
        if unknown := sorted(names - known):
            raise InputError(
                f"{where}: {unknown[0]!r} is not known in source {name!r}; columns, values and constants are"
                f" {sorted(known)}"
            )
        wanted.update(names)

    for reader_key, reader in spec.readers().items():
        for quantity_name, quantity in reader.quantities.items():
            if (source_of_quantity(quantity) or spec.source_of(reader)) == name:
                for formula in quantity.formulas:
                    want(formula, f"{spec.path}.{reader_key}.{quantity_name}")
    for key, formula in reversed(source.values.items()):
        if key in wanted:
            want(formula, f"{path}.values.{key}")
    if both := sorted(set(constants) & set(source.columns)):
        raise InputError(f"{path}.columns: {both} are names of constants as well; rename one")
    return wanted & set(source.columns)


def _column(table: Table, column: ColumnSpec, where: str) -> np.ndarray:
    # A copy: `missing` fills it, another key's may not.
    values = np.array(table.numbers(column.column, where))
    if column.empty is not None:
        values = np.where(values == column.empty, np.nan, values)
    return values.T if column.transpose else values


def _count(columns: dict[str, np.ndarray], where: str) -> int:
    lengths = {key: len(v) for key, v in columns.items() if v.shape != (1,)}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{where}: columns differ in length: {lengths}; use one source for each")
    if not lengths:
        raise InputError(f"{where}: no column is used, so it has no samples")
    return next(iter(lengths.values()))


def _time(spec: TimeSpec | None, table: Table, count: int, where: str) -> np.ndarray:
    if spec is None:
        if table.time is None:
            raise InputError(f"{where} is missing: {table.path.name} has no time of its own; name its column")
        return table.time
    if spec.column is None and spec.rate_hz is not None:
        return np.arange(count) / spec.rate_hz + spec.offset_s
    name, where = str(spec.column), f"{where}.column"
    scale = 1.0 / spec.rate_hz if spec.rate_hz is not None else factor("time", spec.unit, where)
    values = table.times(name, where) if spec.iso else numbers_of_column(table, name, where, count) * scale
    if spec.nanoseconds is not None:
        values = values + 1e-9 * table.numbers(spec.nanoseconds, f"{where}.nanoseconds")
    if spec.microseconds is not None:
        values = values + 1e-6 * table.numbers(spec.microseconds, f"{where}.microseconds")
    if values.ndim != 1:
        raise InputError(f"{where}: {name!r} has shape {values.shape}, must be one number per sample")
    return values + spec.offset_s


def numbers_of_column(table: Table, name: str, where: str, count: int | None = None) -> np.ndarray:
    """A column, or one of an array's such as `pose[0]`; of `count` samples an array may have a row each."""
    part = _ONE_OF_ARRAY.fullmatch(name)
    if name in table.columns or part is None:
        return table.numbers(name, where)
    values = table.numbers(part[1], where)
    if values.ndim == 2 and values.shape[1] == count != len(values):
        values = values.T  # a row per signal, as Simulink's To File stores them
    if values.ndim != 2 or int(part[2]) >= values.shape[1]:
        raise InputError(f"{where}: {part[1]!r} has shape {values.shape}, so no number {part[2]} per sample")
    return values[:, int(part[2])]


def _rows(spec: LoggedSpec, count: int) -> np.ndarray:
    keep = np.ones(count, dtype=bool)
    if spec.rows is not None:
        begin, end = (None if v is None else int(v) for v in spec.rows)
        keep[:] = False
        keep[begin:end] = True
    return keep


def _fill(
    values: np.ndarray, rule: Missing, time: np.ndarray, keep: np.ndarray, where: str, notes: list[str]
) -> np.ndarray:
    """Rows to keep for a column; `hold` and `linear` fill the empty cells of `values` in place."""
    if values.shape == (1,):
        return np.ones(len(keep), dtype=bool)
    cells = values if values.ndim == 2 else values[:, None]
    empty = ~np.isfinite(cells)
    absent: np.ndarray = np.any(empty, axis=1)
    if not (absent & keep).any():
        return np.ones(len(keep), dtype=bool)
    count = int((empty & keep[:, None]).sum())
    if rule == "error":
        raise InputError(
            f"{where}: {count} cells are missing, first in row {int(np.flatnonzero(absent & keep)[0])}; set"
            " `missing` to drop_row, hold or linear"
        )
    notes.append(f"{where}: {count} missing cells, {rule}")
    if rule == "drop_row":
        return np.logical_not(absent)
    if rule == "drop_cell":  # the cell stays NaN
        return np.ones(len(keep), dtype=bool)
    row, inside = np.arange(len(keep)), np.ones(len(keep), dtype=bool)
    for column, gap in zip(cells.T, empty.T, strict=True):  # views: the fill lands in `values`
        known = np.flatnonzero(~gap & np.isfinite(time))
        if not len(known):
            raise InputError(f"{where}: all cells are missing")
        if rule == "hold":
            last = np.maximum.accumulate(np.where(gap, -1, row))
            column[gap] = column[np.maximum(last, 0)][gap]
        else:
            known = known[np.argsort(time[known], kind="stable")]
            column[gap] = np.interp(time[gap], time[known], column[known])
        inside &= (row >= known.min()) & ((row <= known.max()) | (rule == "hold"))  # nothing to go by beyond
    return inside
