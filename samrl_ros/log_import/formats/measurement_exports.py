"""Text that measuring software exports, and that says itself what its columns are.

LabVIEW's measurement files (.lvm): a header of keys and values, then segments, each with a header of its own
(NI, Specification for the LabVIEW Measurement File). TwinCAT Scope's CSV: rows of metadata whose key is
repeated above the time of each group of channels (Beckhoff, TE13xx, Export). InfluxDB's annotated CSV: a row
per number, whose field and tags name it (Influx, Annotated CSV). Units that a file states become part of a
column's name, `Rotor Angle [deg]`.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats.teleplot import is_teleplot, read_teleplot
from samrl_ros.log_import.table import Table

_END = "***End_of_Header***"
_SCOPE_ROWS = ("SymbolComment", "Data-Type", "SampleTime[ms]", "SymbolName")  # one of them tells the layout
_SCOPE_HEAD = 40  # lines within which its channels begin
_PLAIN_TAGS = frozenset(("", "result", "table", "_start", "_stop", "_time", "_value", "_field"))
_EVEN = 1e-3  # share by which a step may differ from the stated one


def read_measurement_export(path: Path, lines: Sequence[str]) -> Table | None:
    """The table of an export; None of any other text.

    Args:
        path: of the file.
        lines: its text.

    Raises:
        InputError: an export that contradicts itself, or whose clocks differ.
    """
    read = _reader_of(lines)
    return None if read is None else read(path, lines)


def is_measurement_export(lines: Sequence[str]) -> bool:
    """Whether a text that begins with these lines is one; nothing is read."""
    return _reader_of(lines) is not None


def _reader_of(lines: Sequence[str]) -> Callable[[Path, Sequence[str]], Table] | None:
    first = lines[0].strip().lstrip("\ufeff") if lines else ""
    if first.startswith("LabVIEW Measurement"):
        return _read_labview
    if first.startswith(("#group,", "#datatype,", "#default,")):
        return _read_influx
    head = [line.strip() for line in lines[:_SCOPE_HEAD]]
    if first.startswith("Name") and any(line.startswith(_SCOPE_ROWS) for line in head):
        return _read_scope
    return read_teleplot if is_teleplot(head) else None


def _read_labview(path: Path, lines: Sequence[str]) -> Table:
    """All segments below each other; a clock that starts anew with each is for the mapping to part."""
    ends = [k for k, line in enumerate(lines) if line.startswith(_END)]
    about = _keys(lines[1 : ends[0]], "\t") if ends else {}
    if len(ends) < 2 or ends[-1] + 1 == len(lines):
        raise InputError(f"{path.name} ends within its headers, so it holds no table; export it anew")
    between = "," if about.get("Separator", ["Tab"])[0] == "Comma" else "\t"
    decimal = about.get("Decimal_Separator", ["."])[0]
    kind = about.get("X_Columns", ["One"])[0]
    if kind == "Multi":
        raise InputError(f"{path.name} has a time column for each channel; write it with X_Columns One")
    names: list[str] = []
    rows: list[np.ndarray] = []
    times: list[np.ndarray] = []
    for number, end in enumerate(ends[1:], start=1):
        said = _keys(lines[ends[number - 1] + 1 : end], between)
        stop = ends[number + 1] if number + 1 < len(ends) else len(lines)
        titles = [cell.strip() for cell in lines[end + 1].split(between)]
        width = len(titles) - (titles[-1] == "Comment")
        own = [line for line in lines[end + 2 : stop] if _is_row(line, between, decimal)]
        block = _numbers_in(own, between, decimal, width)
        titles = _with_units(titles[1:width], said.get("Y_Unit_Label", []))
        if names and titles != names:
            raise InputError(
                f"{path.name}: segment {number} holds {', '.join(titles)}, the first {', '.join(names)};"
                " export a file for each"
            )
        names = titles
        if kind == "No":
            begin, step = (float(said[key][0].replace(decimal, ".")) for key in ("X0", "Delta_X"))
            times.append(begin + step * np.arange(len(block)))
        else:
            times.append(block[:, 0])
        rows.append(block[:, 1:])
    cells, time = np.vstack(rows), np.concatenate(times)
    columns: dict[str, np.ndarray | pd.Series] = {"X_Value [s]": time}
    columns |= {name: cells[:, k].copy() for k, name in enumerate(names)}
    return Table(path, columns, time=time, maker="LabVIEW")


def _read_scope(path: Path, lines: Sequence[str]) -> Table:
    """Groups of channels with a time each; those whose times are not the first's are left out, and noted."""
    at = next(k for k, line in enumerate(lines) if line.lstrip().startswith(_SCOPE_ROWS))
    between = next((mark for mark in ("\t", ";", ",") if mark in lines[at].strip("\r\n")), "\t")
    decimal = "," if between != "," and any("," in line for line in lines[at + 3 : at + _SCOPE_HEAD]) else "."
    head = at
    while head > 0 and lines[head - 1].strip():
        head -= 1
    begin = next(
        (k for k in range(at, len(lines)) if _is_row(lines[k], between, decimal) and lines[k][0].isdigit()),
        len(lines),
    )
    meta = {
        cells[0].strip(): [cell.strip() for cell in cells]
        for cells in (line.rstrip("\r\n").split(between) for line in lines[head:begin])
        if cells[0].strip()
    }
    labels = meta.get("Name") or meta.get("SymbolName") or []
    key = labels[0] if labels else ""
    clocks = [k for k, cell in enumerate(labels) if cell == key]
    cells = _numbers_in([line for line in lines[begin:] if line.strip()], between, decimal, len(labels))
    if not len(cells):
        raise InputError(f"{path.name} holds metadata of TwinCAT Scope and no row of numbers below it")
    period, units = meta.get("SampleTime[ms]", []), meta.get("Unit", [])
    time = _scope_time(path, cells[:, clocks[0]], _cell(period, clocks[0] + 1).replace(",", "."))
    table = Table(path, {"time [s]": time}, time=time, maker="TwinCAT Scope")
    for begin, end in zip(clocks, [*clocks[1:], len(labels)], strict=True):
        for k in range(begin + 1, end):
            if not labels[k]:
                continue
            unit = _cell(units, k)
            name = f"{labels[k]} [{unit}]" if unit and unit != "(None)" else labels[k]
            if np.array_equal(cells[:, begin], cells[:, clocks[0]]):
                table.columns[name] = cells[:, k].copy()
            else:
                table.notes.append(f"{name} has a time of its own and is left out: export it at one rate")
    return table


def _scope_time(path: Path, written: np.ndarray, period: str) -> np.ndarray:
    """Times [s] of a group (N,), which exports write in ms or as numbers of samples."""
    steps = np.diff(written)
    step = float(np.median(steps)) if len(steps) else 0.0
    try:
        stated = float(period)
    except ValueError:
        stated = step
    if step > 0 and abs(step - stated) <= _EVEN * stated:
        return written * 1e-3
    if step == 1.0 and stated > 0:
        return written * stated * 1e-3
    raise InputError(
        f"{path.name}: its times grow by {step:g}, SampleTime[ms] is {period or 'not stated'}; export times"
        " in ms, without a compressed timeline"
    )


def _read_influx(path: Path, lines: Sequence[str]) -> Table:
    """A column for each field, and for each set of tags that differ; numbers of one stamp are a row.

    Files hold several tables below each other, each with its annotations and names.
    """
    frames, block = [], []
    for line in [*lines, "#"]:
        if line.startswith("#") or not line.strip():
            if len(block) > 1:
                frames.append(pd.read_csv(io.StringIO("".join(block)), dtype=str, keep_default_na=False))
            block = []
        else:
            block.append(line if line.endswith("\n") else line + "\n")
    frame = pd.concat(frames, ignore_index=True).fillna("") if frames else pd.DataFrame()
    if not {"_time", "_value", "_field"} <= set(frame.columns):
        raise InputError(
            f"{path.name} is annotated CSV of InfluxDB without _time, _value and _field; export what `from`"
            " and `range` give, without `pivot`"
        )
    plain = [name for name in frame.columns if name in _PLAIN_TAGS or name.startswith("Unnamed")]
    tags = [name for name in frame.columns if name not in plain and frame[name].nunique() > 1]
    frame["name"] = frame["_field"]
    for tag in tags:
        frame["name"] += np.where(frame[tag] == "", "", "." + frame[tag])
    moments = pd.to_datetime(frame["_time"], format="ISO8601", utc=True)
    frame["ns"] = moments.astype("datetime64[ns, UTC]").astype("int64")
    frame["number"] = pd.to_numeric(frame["_value"], errors="coerce")
    if bool(frame.duplicated(["ns", "name"]).any()):
        twice = frame.loc[frame.duplicated(["ns", "name"]), "name"].iloc[0]
        raise InputError(f"{path.name}: {twice!r} has two values at one time; export one run and one tag set")
    wide = frame.pivot(index="ns", columns="name", values="number").sort_index()
    time = wide.index.to_numpy() / 1e9
    columns: dict[str, np.ndarray | pd.Series] = {
        name: wide[name].to_numpy(dtype=float, copy=True)
        for name in dict.fromkeys(frame["name"])
        if wide[name].notna().any()
    }
    return Table(path, {"_time [s]": time, **columns}, time=time, maker="InfluxDB")


def _keys(lines: Sequence[str], between: str) -> dict[str, list[str]]:
    cells = [[cell.strip() for cell in line.rstrip("\r\n").split(between)] for line in lines]
    return {row[0]: row[1:] for row in cells if len(row) > 1 and row[0]}


def _with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    told = [f"{name} [{unit}]" if (unit := _cell(units, k)) else name for k, name in enumerate(names)]
    return [f"{name} ({k + 1})" if told.count(name) > 1 else name for k, name in enumerate(told)]


def _cell(row: Sequence[str], k: int) -> str:
    return row[k].strip() if k < len(row) else ""


def _is_row(line: str, between: str, decimal: str) -> bool:
    """Whether the first cell that holds something is a number."""
    filled = [cell.strip() for cell in line.split(between) if cell.strip()]
    try:
        float(filled[0].replace(decimal, ".") if filled else "no")
    except ValueError:
        return False
    return True


def _numbers_in(lines: Sequence[str], between: str, decimal: str, width: int) -> np.ndarray:
    """Cells (N, width); empty ones are NaN, a comment behind them is left out."""
    if not lines:
        return np.empty((0, width))
    text = "\n".join(between.join(line.rstrip("\r\n").split(between)[:width]) for line in lines)
    frame = pd.read_csv(
        io.StringIO(text), sep=between, header=None, names=range(width), decimal=decimal, index_col=False
    )
    return frame.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
