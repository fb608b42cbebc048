"""Text files with a line per sample: .csv, .tsv, .txt, and what motion captures and scopes export."""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats.colmap import is_colmap, read_colmap
from samrl_ros.log_import.formats.encoding import decoded_text
from samrl_ros.log_import.formats.header_lines import holds_row, join_names
from samrl_ros.log_import.formats.measurement_exports import is_measurement_export, read_measurement_export
from samrl_ros.log_import.formats.motion_capture import read_motion_capture
from samrl_ros.log_import.formats.name_value import part_names
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table

_EMPTY = ["-", "na", "Na", "NAN", "Nan", "none", "NONE", "Null"]  # besides those that pandas knows


def read_text_table(path: Path, part: str, options: CsvOptions, where: str) -> Table:
    """Lines as rows; without options a motion capture's export is read as what it is.

    Args:
        path: of the file.
        part: what its rows are of, where a column says it (`options.label`); else empty.
        options: how it is written.
        where: key path, for messages.

    Raises:
        InputError: a header that names a column twice, or lists another number of columns than there are; a
            part without a label, or of which there is no row.
        Exception: what pandas raises.
    """
    tab = path.suffix.lower() == ".tsv" and options.delimiter == ","
    how: dict[str, Any] = {"sep": "\t" if tab else options.delimiter, "skipinitialspace": True}
    if how["sep"] == " ":
        how["sep"] = r"\s+"
    lines = list(io.StringIO(decoded_text(path), newline=""))
    if options == CsvOptions() and (known := _read_known_export(path, lines)) is not None:
        return known
    rows = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if number > options.skip_lines and not (options.comment and line.startswith(options.comment))
    ]
    written: list[str] | None = None
    notes: list[str] = []
    if options.pairs:
        written, values, notes = part_names(
            rows, options.pairs, "\t" if tab else options.delimiter, options.decimal, path, where
        )
        text, how["sep"] = _written_out(values), "\t"
    else:
        if options.header_lines > 1:
            written, rows = _below_names(rows, options.header_lines, how["sep"], path, where)
        text = "".join(line for _, line in rows)
    first = pd.read_csv(io.StringIO(text), header=None, nrows=1, dtype=str, keep_default_na=False, **how)
    listed = isinstance(options.header, list)
    head = options.header if isinstance(options.header, list) else first.columns
    if options.header is True:
        head = first.iloc[0] if written is None else written
    names = [str(name).strip() for name in head]
    if double := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(
            f"{where}: {path.name} names columns {double} twice; set header: false and use numbers"
        )
    if (listed or written is not None) and len(names) != first.shape[1]:
        said = "csv.header lists" if listed else f"csv.header_lines {options.header_lines} name"
        raise InputError(f"{where}: {said} {len(names)} columns, {path.name} has {first.shape[1]}")
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # else cells beyond the header are dropped
        frame = pd.read_csv(
            io.StringIO(text),
            header=0 if options.header is True and written is None else None,
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
    if options.rows_per_sample > 1:
        where = f"{where}: {path.name}"
        columns = {"data": _folded(list(columns.values()), options.rows_per_sample, where)}
    if part or options.label:
        columns = rows_of(columns, part, options.label, f"{where}: {path.name}")
    return Table(path, columns, options.decimal, notes=notes)


def _written_out(rows: Sequence[Sequence[str]]) -> str:
    """Cells as text that tabs part."""
    text = io.StringIO()
    csv.writer(text, delimiter="\t", lineterminator="\n").writerows(rows)
    return text.getvalue()


def _below_names(
    rows: Sequence[tuple[int, str]], count: int, sep: str, path: Path, where: str
) -> tuple[list[str], list[tuple[int, str]]]:
    """Names that several lines give together, and the lines below them.

    Raises:
        InputError: a row of numbers among them, or lines of different length.
    """
    filled = [(number, line) for number, line in rows if line.strip()]
    parted = re.compile(sep) if len(sep) > 1 else None
    head = [
        parted.split(line.strip())
        if parted
        else next(csv.reader([line], delimiter=sep, skipinitialspace=True))
        for _, line in filled[:count]
    ]
    for (number, _), cells in zip(filled, head, strict=False):
        if holds_row(cells) or len(cells) != len(head[0]):
            raise InputError(
                f"{where}: line {number} of {path.name} is {','.join(cells)[:80]!r}, must be one of"
                f" {count} lines of {len(head[0])} names each, as csv.header_lines says; correct it, or that"
                " number"
            )
    return join_names(head) if head else [], filled[count:]


def is_known_export(path: Path, lines: Sequence[str]) -> bool:
    """Whether a text that begins with these lines says itself how it is laid out."""
    return is_colmap(lines) or read_motion_capture(path, lines) is not None or is_measurement_export(lines)


def _read_known_export(path: Path, lines: Sequence[str]) -> Table | None:
    if (images := read_colmap(path, lines)) is not None:
        return images
    captured = read_motion_capture(path, lines)
    return captured if captured is not None else read_measurement_export(path, lines)


def _folded(columns: list[np.ndarray | pd.Series], count: int, where: str) -> np.ndarray:
    """Matrices that stand below each other, a sample each (N, count * width), row by row.

    Raises:
        InputError: lines that are no numbers, or not a whole number of matrices.
    """
    numbers = [each for each in columns if isinstance(each, np.ndarray)]
    if len(numbers) != len(columns) or len(numbers[0]) % count:
        raise InputError(
            f"{where} has {len(columns[0])} lines in {len(numbers)} columns of numbers; csv.rows_per_sample"
            f" is {count}, so as many lines of numbers alone must be a sample"
        )
    return np.column_stack(numbers).reshape(-1, count * len(numbers))


def rows_of(
    columns: dict[str, np.ndarray | pd.Series], part: str, label: str, where: str
) -> dict[str, np.ndarray | pd.Series]:
    """Rows whose label is the part, without the label.

    Raises:
        InputError: a part without a label, no such column, or no such row.
    """
    if not label:
        raise InputError(
            f"{where} has no parts, so no {part!r}; `csv.label` names a column that says what a row is of"
        )
    if label not in columns:
        raise InputError(f"{where} has no column {label!r} that `csv.label` names")
    labels = labels_in(columns[label])
    keep = labels == part
    if not keep.any():
        present = ", ".join(map(repr, list(dict.fromkeys(map(str, labels)))[:10]))
        raise InputError(f"{where} has no rows of {part!r}; `part` names one of {present}")
    return {
        name: values[keep]
        if isinstance(values, np.ndarray)
        else pd.Series(np.asarray(values, dtype=object)[keep])
        for name, values in columns.items()
        if name != label
    }


def labels_in(cells: np.ndarray | pd.Series) -> np.ndarray:
    """What each row (N,) is of, as text; a number as it is written: 7, where a column holds 7.0."""
    numbers = isinstance(cells, np.ndarray)
    return np.array([f"{cell:.15g}" if numbers else str(cell).strip() for cell in cells])
