"""Tables with a row per joint: several rows below each other are one sample, and a column says whose each is.

`t,joint,q,tau` as data frames are tidied, and as a bus of motors is logged that answer one after the other.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from samrl_core.common.errors import InputError
from samrl_ros.log_import.formats.text import labels_in
from samrl_ros.log_import.table import Table

_WORDS = re.compile(r"[A-Za-z]+")
_JOINTS = frozenset("axis joint motor servo actuator drive dof".split())
_NUMBERED = frozenset("id name no nr num number idx index can label".split())
_MOST = 32  # joints of a machine
_LEAST = 20  # rows of each
_ALIKE = 0.95  # of the rows within samples, in which a column that all joints share stands still
_FOLLOWS = 0.9  # of the rows, that are of the joint whose turn it is
_RUNS_ON = 0.99  # of all rows, in which a clock does not go back


def find_joint_column(table: Table, joints: Sequence[str] = ()) -> str:
    """The column that says which joint a row is of; empty where rows are whole samples.

    It is called by what it numbers (`axis`, `motor_id`), or holds names of the machine's `joints`; its few
    labels take turns.
    """
    for name, cells in table.columns.items():
        words = {word.lower() for word in _WORDS.findall(name)}
        if np.ndim(cells) != 1 or len(table.columns) < 3 or len(cells) < 2 * _LEAST:
            continue
        called = bool(words & _JOINTS) and not words - _JOINTS - _NUMBERED
        if not called and not set(labels_in(cells[:_MOST])) <= set(joints):
            continue
        labels = labels_in(cells)
        order, counts = np.unique(labels, return_counts=True)
        if not 1 < len(order) <= _MOST or counts.min() < max(_LEAST, 0.5 * counts.max()):
            continue
        if _take_turns(_places(labels), len(order)):
            return name
    return ""


def join_samples(table: Table, column: str, where: str) -> Table:
    """The same with a row per sample: `q` of the joint `J1` becomes `q.J1`.

    A column that is the same for all joints of a sample keeps its name. So does a clock that runs on from row
    to row, as motors answer in turn: a sample has its first row's. A joint that a sample lacks has NaN there.

    Args:
        table: rows of joints.
        column: that says whose a row is.
        where: key path, for messages.

    Raises:
        InputError: no such column, or one joint alone.
    """
    if column not in table.columns:
        present = ", ".join(map(repr, table.columns)) or "none"
        raise InputError(f"{where}: {table.path.name} has no column {column!r}; it has {present}")
    labels = labels_in(table.columns[column])
    joints = list(dict.fromkeys(labels))
    if len(joints) < 2 or len(joints) > _MOST:
        raise InputError(
            f"{where}: column {column!r} of {table.path.name} names {len(joints)} joints, must be 2 to"
            f" {_MOST} that take turns; leave joint_column out"
        )
    place = _places(labels)
    begins = np.concatenate([[True], np.diff(place) <= 0])
    others = {name: cells for name, cells in table.columns.items() if name != column}
    shared = [name for name, cells in others.items() if np.ndim(cells) == 1 and _is_shared(cells, begins)]
    for name in shared:  # where rows are lost, what all joints share tells samples apart
        begins[1:] |= _changes(others[name])
    sample = np.cumsum(begins) - 1
    first = np.flatnonzero(begins)
    clocks = [name for name, cells in others.items() if name not in shared and _runs_on(cells)]
    notes, columns = list(table.notes), {}
    for name, cells in others.items():
        if name in shared or name in clocks:
            columns[name] = (
                cells[first] if isinstance(cells, np.ndarray) else cells.iloc[first].reset_index(drop=True)
            )
            if name in clocks:
                apart = np.asarray(cells, dtype=float) - np.asarray(cells, dtype=float)[first][sample]
                notes.append(
                    f"{name!r} runs on from joint to joint: a sample has its first row's, the last lies"
                    f" {np.median(apart[np.r_[first[1:] - 1, len(apart) - 1]]):.3g} later"
                )
            continue
        for number, joint in enumerate(joints):
            rows = place == number
            columns[f"{name}.{joint}"] = _spread(cells, rows, sample[rows], len(first))
    lacking = len(first) * len(joints) - len(labels)
    if lacking:
        notes.append(f"{lacking} rows of joints are missing in {len(first)} samples by {column!r}")
    return replace(
        table, columns=columns, notes=notes, time=None if table.time is None else table.time[first]
    )


def _places(labels: np.ndarray) -> np.ndarray:
    """Number (N,) of each row's joint, in the order in which they first stand."""
    numbers = {label: k for k, label in enumerate(dict.fromkeys(labels))}
    return np.array([numbers[label] for label in labels])


def _take_turns(place: np.ndarray, count: int) -> bool:
    """Whether most rows follow the joint before theirs: not runs of one joint below each other."""
    return bool((np.diff(place) % count == 1).mean() > _FOLLOWS)


def _changes(cells: np.ndarray | pd.Series) -> np.ndarray:
    """Whether a row (N - 1,) differs from the one before; two empty cells are alike."""
    values = np.asarray(cells)
    empty = np.asarray(pd.isna(cells))
    return np.asarray((values[1:] != values[:-1]) & ~(empty[1:] & empty[:-1]))


def _is_shared(cells: np.ndarray | pd.Series, begins: np.ndarray) -> bool:
    """Whether a column changes, and from sample to sample alone."""
    changes = _changes(cells)
    within = ~begins[1:]
    return bool(changes.any()) and 1.0 - changes[within].mean() > _ALIKE


def _runs_on(cells: np.ndarray | pd.Series) -> bool:
    """Whether numbers grow from row to row: no joint's reading does, across joints."""
    if not isinstance(cells, np.ndarray) or cells.ndim != 1 or not np.isfinite(cells).all():
        return False
    return bool((np.diff(cells) >= 0).mean() > _RUNS_ON and np.ptp(cells) > 0)


def _spread(
    cells: np.ndarray | pd.Series, rows: np.ndarray, sample: np.ndarray, count: int
) -> np.ndarray | pd.Series:
    """A joint's cells, a row for each of `count` samples."""
    if isinstance(cells, np.ndarray):
        out = np.full((count, *cells.shape[1:]), np.nan)
        out[sample] = cells[rows]
        return out
    text = np.full(count, None, dtype=object)
    text[sample] = np.asarray(cells, dtype=object)[rows]
    return pd.Series(text)
