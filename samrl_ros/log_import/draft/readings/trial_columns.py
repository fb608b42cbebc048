"""Readings side by side: a row for each distance, a column for each trial, as tables by hand have them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import is_time, words_in
from samrl_ros.log_import.table import Table

_COUNTED = re.compile(
    r"(.*?)[ _.\-#\[(]*(\d+)[\])]?((?:[ _(\[]+(?:mm|cm|m)[)\]]?)?)"
)  # trial_3, Trial 3 (cm)
TRIALS = frozenset(
    "sample samples trial trials reading readings measurement measurements measured measure run rep repeat"
    " repetition try test attempt shot messung medida medicion prueba mesure essai misura".split()
)
LEAST_TRIALS = 3  # columns of one name and a number
LEAST_ROWS = 2  # distances
FARTHEST_OFF = 2.0  # factor by which readings are off their distance
ALIKE = 0.9  # correlation of the rows' means with the distances


@dataclass(frozen=True)
class Trials:
    """Columns that hold readings of one distance in each row, and the column of the distances."""

    names: tuple[str, ...]  # in the order of their numbers
    reference: str

    @property
    def label(self) -> str:
        """For sentences, and as a name whose words say the unit."""
        return f"{self.names[0]} to {self.names[-1]}"

    def means(self, table: Table) -> np.ndarray:
        """Of each row (N,), of what is there."""
        rows = np.column_stack([table.numbers(name, "the log") for name in self.names])
        there = np.isfinite(rows)
        return np.where(there, rows, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)


def numbered_names(names: Sequence[str], pattern: re.Pattern[str], words: frozenset[str]) -> list[str]:
    """The most names that differ by a number alone, in its order, and have one of some words; else none.

    Args:
        names: of columns.
        pattern: its first group is what stands before the number, its second the number.
        words: of which what stands before it has one.
    """
    found: dict[tuple[str, ...], list[tuple[int, str]]] = {}
    for name in names:
        parts = pattern.fullmatch(name)
        if parts is not None and set(words_in(parts[1])) & words:
            stem = (parts[1], *parts.groups()[2:])
            found.setdefault(stem, []).append((int(parts[2]), name))
    return [name for _, name in sorted(max(found.values(), key=len, default=[]))]


def find_trials(table: Table, truths: Sequence[str]) -> Trials | None:
    """Columns of trials whose means follow a column of distances in the same unit; None where there are none.

    Args:
        table: of the log.
        truths: columns that are called a true distance.
    """
    names = numbered_names([name for name in table.columns if is_flat(table, name)], _COUNTED, TRIALS)
    if len(names) < LEAST_TRIALS:
        return None
    for reference in truths:
        trials = Trials(tuple(names), reference)
        means, stated = trials.means(table), np.asarray(table.numbers(reference, "the log"))
        both = np.isfinite(stated) & (stated > 0.0) & (means > 0.0)
        if both.sum() < LEAST_ROWS or np.ptp(stated[both]) == 0.0 or np.ptp(means[both]) == 0.0:
            continue
        share = float(np.median(means[both] / stated[both]))
        follows = float(np.corrcoef(means[both], stated[both])[0, 1]) > ALIKE
        if follows and 1.0 / FARTHEST_OFF < share < FARTHEST_OFF:
            return trials
    return None


def is_flat(table: Table, name: str) -> bool:
    """Whether a column has one number a row, and is no time."""
    values = None if is_time(name) else numbers_of(table, name)
    return values is not None and values.ndim == 1
