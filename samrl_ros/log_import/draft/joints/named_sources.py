"""Blocks of a log by what their names mean, and the sources that a draft takes them from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.blocks import LogBlock, LogPart
from samrl_ros.log_import.draft.column_names import NameMeaning, meaning, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.split_stamp import SplitStamp, frame_counter, split_stamp
from samrl_ros.log_import.draft.text_layout import stated_options
from samrl_ros.log_import.sources import numbers_of_column

_COARSE = 0.5  # of the steps: a time that stands still in more of them tells no row from the next
_TOGETHER = 0.5  # of the rows of the shorter of two blocks, which share a source
_RESTART = 10.0  # steps by which a clock goes back where it starts anew
_LEAST_RUN, _MOST_RUNS = 100, 20  # rows of a run, and runs, into which one table is cut


@dataclass(frozen=True, eq=False)
class NamedBlock:
    """A block of a log, and what its names mean."""

    part: LogPart
    block: LogBlock
    meaning: NameMeaning


def name_of(each: NamedBlock) -> str:
    """How messages name a block: topic or file, and column, of several their common form."""
    place = f"{each.part.part}: " if each.part.part else ""
    file = "" if each.part.part else f"{each.part.path.name}: "
    columns = each.block.columns
    return f"{file}{place}{each.block.stem if len(columns) > 1 else columns[0]}"


def column_alone(each: NamedBlock, k: int) -> NamedBlock:
    """One column of a block by itself, under its whole name."""
    name = each.block.columns[k]
    block = replace(each.block, stem=name, labels=("",), columns=(name,), values=each.block.values[:, [k]])
    return replace(each, block=block)


def shares_rows(one: NamedBlock, other: NamedBlock) -> bool:
    """Whether two blocks of a part have their numbers in the same rows.

    PlotJuggler writes topics below each other by time, each with empty cells in the others' rows.
    """
    rows = one.block.rows, other.block.rows
    if one.part is not other.part or len(rows[0]) != len(rows[1]):
        return False
    return int((rows[0] & rows[1]).sum()) >= _TOGETHER * min(int(rows[0].sum()), int(rows[1].sum()))


def of_other_length(one: NamedBlock, other: NamedBlock) -> bool:
    """Whether two blocks of a part have different numbers of rows, so that one time cannot be of both."""
    return one.part is other.part and len(one.block.rows) != len(other.block.rows)


def add_source(part: LogPart, name: str, draft: Draft, beside: str = "") -> np.ndarray:
    """Adds the part as a source; its times [s], by the clock whose name is most like the column `beside`."""
    key, table = f"sources.{name}.time", part.table
    source: dict[str, Any] = {"file": part.path.name}
    if part.part:
        source["part"] = part.part
    if stated := stated_options(part.csv):
        source["csv"] = stated
    if part.joint_column:
        source["joint_column"] = part.joint_column
        draft.note(f"sources.{name}.joint_column", f"{part.joint_column!r} says which joint a row is of")
    draft.sources[name] = source
    rows = len(part.blocks[0].rows)
    if table.time is not None:
        draft.note(key, "the header's stamps" if "header.stamp" in table.columns else "the log's own")
        time = table.time
    elif split := _split_stamp_of(part):
        draft.note(key, f"{split.proof}: whole seconds and their rest")
        source["time"], time = dict(split.entry), split.seconds
    elif column := _clock_of(part, beside):
        values = numbers_of_column(table, column, "the log")
        said = meaning(column).unit if meaning(column).unit in ("s", "ms", "us", "ns") else ""
        units = evidence.time_unit(np.diff(values))
        unit = said or (units[0] if units else "s")
        question = "" if said or len(units) == 1 else f"is {column!r} in {unit}?"
        why = "its name says so" if said else f"steps of {np.median(np.diff(values)):g}"
        draft.note(key, f"{column!r} in {unit}: {why}", question)
        source["time"] = {"column": column, "unit": unit}
        time = values * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
    elif part.dates:
        draft.note(key, f"{part.dates[0]!r} holds dates")
        source["time"] = {"column": part.dates[0], "iso": True}
        time = table.times(part.dates[0], "the log")
    elif counter := frame_counter(table):
        frames = table.numbers(counter, "the log")
        lost = int(frames[-1] - frames[0] + 1 - len(frames))
        why = f", of which {lost} were lost" if lost else ""
        draft.note(
            key, f"{counter!r} counts frames{why}", "what is their rate [Hz]? 100 is a placeholder", "rate"
        )
        source["time"] = {"column": counter, "rate_hz": 100.0}
        time = (frames - frames[0]) / 100.0
    else:
        draft.note(key, "no column is a clock", "what is the rate [Hz]? 100 is a placeholder", "rate")
        source["time"] = {"rate_hz": 100.0}
        time = np.arange(rows) / 100.0
    if "time" in source and (np.diff(time) <= 0).mean() > _COARSE:
        rate = float(f"{rows / max(time[-1] - time[0], 1.0):.3g}")
        same = rows / len(np.unique(time))
        draft.note(
            key, f"it stays the same over {same:.3g} rows, as dates of whole seconds do",
            f"what is the rate [Hz]? {rate:g}, by rows and seconds, is a placeholder", "rate",
        )  # fmt: skip
        source["time"] = {"rate_hz": rate}
        time = np.arange(rows) / rate
    if "time" in source and not _cut_runs(time, key, draft) and (np.diff(time) <= 0).any():
        source["time"] = {**source["time"], "repeated": "drop"}
        behind = int((time[1:] <= np.maximum.accumulate(time)[:-1]).sum())
        draft.note(
            key, f"{int((np.diff(time) <= 0).sum())} steps do not increase; {behind} rows are left out"
        )
    source["columns"] = {}
    return time


def _split_stamp_of(part: LogPart) -> SplitStamp | None:
    """The first column of whole seconds that has the rest of the second beside it."""
    return next((split for name in part.table.columns if (split := split_stamp(part.table, name))), None)


def _clock_of(part: LogPart, beside: str) -> str:
    """The column of time, of several that run on the one called most like another column; empty for none."""
    how = {name: evidence.runs_on(numbers_of_column(part.table, name, "the log")) for name in part.times}
    best = [name for name in part.times if how[name] and how[name] == max(how.values())]
    words = set(words_in(beside))
    return max(best, key=lambda name: len(words & set(words_in(name))), default="")


def _cut_runs(time: np.ndarray, key: str, draft: Draft) -> bool:
    """Whether a clock starts anew and the recording was cut there: runs below each other in one table.

    Where there are too many of them, or short ones, it is asked and nothing is cut.
    """
    step = float(np.median(np.abs(np.diff(time))))
    anew = np.flatnonzero(np.diff(time) < -_RESTART * step) + 1
    if not len(anew):
        return False
    edges = [0, *anew.tolist(), len(time)]
    said = (
        f"the clock starts anew {len(anew)} times, first at row {edges[1]},"
        f" from {time[edges[1] - 1]:.4g} to {time[edges[1]]:.4g} s"
    )
    if len(draft.recordings) != 1 or len(anew) >= _MOST_RUNS or min(np.diff(edges)) < _LEAST_RUN:
        question = (
            "runs, or machines, below each other? Put each into a table of its own; here most are left out"
        )
        draft.note(key, said, question)
        return False
    draft.note(key, said, f"are these {len(anew) + 1} runs of one machine, as they are cut by `rows`?")
    name = draft.recordings[0]["name"]
    draft.recordings[:] = [
        {"name": f"{name}_{k}", "role": "held_out" if k == len(anew) + 1 else "fit", "rows": [first, end]}
        for k, (first, end) in enumerate(zip(edges[:-1], edges[1:], strict=True), 1)
    ]
    return True


def quantity_of(each: NamedBlock, order: list[str], unit: str, draft: Draft, source: str) -> dict[str, Any]:
    """A quantity in the order of the joints; its columns are added to the source."""
    block = each.block
    columns: dict[str, Any] = draft.sources[source]["columns"]
    prefix = "_".join(word for word in words_in(block.stem) if word.isidentifier())[:24] or "x"
    if not prefix.isidentifier():
        prefix = f"x_{prefix}"
    if not block.rows.all():
        draft.sources[source]["missing"] = "drop_row"
    if len(block.columns) == 1 and len(block.labels) > 1:
        name = block.columns[0]
        entry = {"column": name, "transpose": True} if block.transposed else name
        key = next((key for key, there in columns.items() if there == entry), "") or _free(columns, prefix)
        columns[key] = entry
        numbers = [block.first + block.labels.index(label) for label in order]
        return {"formula": [f"{key}[{number}]" for number in numbers], "unit": unit}
    formulas = []
    for number, label in enumerate(order, 1):
        key = _free(columns, f"{prefix}_{number}")
        columns[key] = block.columns[block.labels.index(label)]
        formulas.append(key)
    return {"formula": formulas, "unit": unit}


def _free(columns: dict[str, Any], name: str) -> str:
    while name in columns or name == "time":
        name += "_"
    return name
