"""Lines as Teleplot reads them from a port: a name, its own time in ms and its number, `>speed:48211:0.3`.

The time may lack (`>speed:0.3`), several samples may stand in a line (`>speed:1:0.3;2:0.4`), a unit and flags
behind it (`>speed:1:0.3§m/s|g`). Teleplot, README, "Telemetry format".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.table import NUMBER, Table

_SAMPLE = rf"(?:(?:{NUMBER}):)?(?:{NUMBER})"
_LINE = re.compile(  # a § of UTF-8 is `Â§` where bytes are looked at one by one
    rf"(>?)([^\W\d][^:;§|\"'{{}}]*):({_SAMPLE}(?:;{_SAMPLE})*);?(?:Â?§([^|]*))?(?:\|\w*)?", re.IGNORECASE
)
_FEW = 3  # lines that show how a file is written
_MOST = 0.8  # of the lines, between which a firmware may print what it likes
_PLACED = 0.5  # of a name's numbers, that are beside the others': fewer are at a clock of their own
_Samples = dict[str, tuple[list[float], list[float]]]  # times [s], NaN where they lack, and numbers


def is_teleplot(lines: Sequence[str]) -> bool:
    """Whether a text that begins with these lines is of Teleplot's."""
    filled = [line.strip() for line in lines if line.strip()]
    found = [match for line in filled if (match := _LINE.fullmatch(line))]
    told = [match for match in found if match[1] or ":" in match[3]]  # `name:1` alone may be anything
    return len(told) >= _FEW and len(told) >= _MOST * len(filled)


def read_teleplot(path: Path, lines: Sequence[str]) -> Table:
    """A column for each name; numbers within half a step of those of the name with the most are their row.

    Without times, which number is in which row tells their count.

    Args:
        path: of the file.
        lines: its text.

    Raises:
        InputError: some lines have a time and others none; without times, names with different counts.
    """
    samples: _Samples = {}
    lost = 0
    for line in lines:
        if not line.strip():
            continue
        read = list(_samples_in(line))
        lost += not read
        for name, moment, number in read:
            times, numbers = samples.setdefault(name, ([], []))
            times.append(moment)
            numbers.append(number)
    notes = (
        [f"{path.name}: lines that are no NAME:MS:NUMBER are left out, {lost} of {len(lines)}"]
        if lost
        else []
    )
    bare = [name for name, (times, _) in samples.items() if np.isnan(times).any()]
    if not bare:
        return _by_times(path, samples, notes)
    if any(np.isfinite(samples[name][0]).any() for name in samples):
        raise InputError(
            f"{path.name}: numbers of {bare[0]!r} have no time, others have; log each as >{bare[0]}:MS:NUMBER"
        )
    counts = {name: len(numbers) for name, (_, numbers) in samples.items()}
    if max(counts.values()) - min(counts.values()) > 1:  # one row may be cut short
        told = ", ".join(f"{name!r} {count}" for name, count in counts.items())
        raise InputError(
            f"{path.name}: names without times have different counts of numbers, {told}: which are of one row"
            f" is open; log them with their time, as >{bare[0]}:MS:NUMBER"
        )
    rows = min(counts.values())
    return Table(
        path, {n: np.array(v[:rows]) for n, (_, v) in samples.items()}, notes=notes, maker="Teleplot"
    )


def _samples_in(line: str) -> Iterator[tuple[str, float, float]]:
    """Names with their units, times [s] and numbers of a line; none of one that is not Teleplot's."""
    match = _LINE.fullmatch(line.strip())
    if match is None:
        return
    unit = (match[4] or "").strip()
    name = f"{match[2].strip()} [{unit}]" if unit else match[2].strip()
    for sample in match[3].split(";"):
        moment, _, number = sample.rpartition(":")
        yield name, float(moment) * 1e-3 if moment else np.nan, float(number)


def _by_times(path: Path, samples: _Samples, notes: list[str]) -> Table:
    """Rows at the times of the name with the most numbers."""
    first = max(samples, key=lambda name: len(samples[name][0]))
    time = np.array(samples[first][0])
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    columns: dict[str, np.ndarray | pd.Series] = {"time [s]": time}
    for name, (times, numbers) in samples.items():
        own = np.array(times)
        if np.array_equal(own, time):
            columns[name] = np.array(numbers)
            continue
        row = _nearest(time, own)
        near = np.abs(time[row] - own) <= 0.5 * step
        if near.mean() < _PLACED or len(np.unique(row[near])) < _PLACED * len(own):
            notes.append(f"{name} is at another clock than {first} and is left out: log both at one time")
            continue
        cells = np.full(len(time), np.nan)
        cells[row[near]] = np.array(numbers)[near]
        columns[name] = cells
        if empty := int(np.isnan(cells).sum()):
            notes.append(
                f"{name} has no number in {empty} of {len(time)} rows, which are the times of {first}"
            )
    return Table(path, columns, time=time, notes=notes, maker="Teleplot")


def _nearest(time: np.ndarray, own: np.ndarray) -> np.ndarray:
    """The row (K,) of a clock (N,) that is nearest to each of some times (K,)."""
    order = np.argsort(time, kind="stable")
    above = np.clip(np.searchsorted(time[order], own), 1, max(len(time) - 1, 1))
    lower, upper = order[above - 1], order[np.minimum(above, len(time) - 1)]
    return np.where(own - time[lower] <= time[upper] - own, lower, upper)
