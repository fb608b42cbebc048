"""Text files with a line per sample: .csv, .tsv, .txt."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table

_EMPTY = ["-", "na", "Na", "NAN", "Nan", "none", "NONE", "Null"]  # besides those that pandas knows


def read_text_table(path: Path, options: CsvOptions, where: str) -> Table:
    """Lines as rows. Raises `InputError` for a header that names a column twice, or what pandas raises."""
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
