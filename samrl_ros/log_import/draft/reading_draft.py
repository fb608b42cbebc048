"""Drafts a mapping of depth readings: which column the sensor gave, which is the true distance, the unit.

Nothing but names says which of two columns is the truth: a factor of 1.01 is 0.99 the other way round. Metres
show in the numbers, since no depth camera measures 100 m; between cm and mm a name must decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from samrl_core.common.files import is_file
from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import is_time, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.formats.rosbag import is_bag
from samrl_ros.log_import.pose_specs import LENGTHS
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import SUFFIXES, read_table

DEPTH = frozenset("depth range tof lidar".split())
TRUTH = frozenset("true truth reference ref gt groundtruth ground actual laser plane distance".split())
GIVEN = frozenset("measured raw reading sensor camera cam estimated est".split())
FARTHEST, NEAREST = 30.0, 0.05  # [m] that depth cameras measure
ALIKE = 0.9  # correlation of a reading with its reference
LEAST = 50  # rows


def draft_readings(paths: Sequence[Path]) -> Draft | None:
    """A draft of a table that holds a depth and its reference; None of any other log.

    Raises:
        InputError: a file that cannot be read.
    """
    if len(paths) != 1 or is_bag(paths[0]) or not is_file(paths[0]):
        return None
    (path,) = paths
    if path.suffix.lower() not in SUFFIXES:
        return None
    table = read_table(path, CsvOptions(), "the log", "")
    columns = {name: values for name in table.columns if (values := _numbers(table, name)) is not None}
    read = [name for name in columns if _says_depth(name) and not _says_truth(name)]
    true = [name for name in columns if _says_truth(name)]
    if not read or not true:
        return None
    pairs = [(a, b) for a in read for b in true if _alike(columns[a], columns[b])]
    if not pairs:
        return None
    return _drafted(path, columns, pairs)


def _drafted(path: Path, columns: dict[str, np.ndarray], pairs: list[tuple[str, str]]) -> Draft:
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    reading, reference = pairs[0]
    several = len(pairs) > 1
    draft.note(
        "readings",
        f"{reading!r} is what the sensor gave, {reference!r} how far it was: by their names",
        f"is it {reading!r} against {reference!r}, and not {_listed(pairs[1:])}?" if several else "",
    )
    both = np.isfinite(columns[reading]) & np.isfinite(columns[reference])
    typical = float(np.median(columns[reference][both]))
    known = [unit for unit, factor in LENGTHS.items() if NEAREST < factor * typical < FARTHEST]
    said = [unit for unit in known if unit in {w for n in (reading, reference) for w in words_in(n)}]
    unit = (said or known or ["m"])[0]
    why = "by their names" if said else f"half of the distances are beyond {typical:.4g}"
    others = " or ".join(each for each in known if each != unit) or "another"
    question = "" if said or known == [unit] else f"is the unit {unit}, and not {others}?"
    draft.note("readings", f"in {unit}: {why}", question)
    draft.sources["log"] = {"file": path.name, "columns": {"reading": reading, "reference": reference}}
    if not both.all():
        draft.sources["log"]["missing"] = "drop_row"
    draft.readings = {"quantity": "depth", "reading": "reading", "reference": "reference", "unit": unit}
    draft.recordings = [{"name": path.stem, "role": "fit"}]
    draft.unused += [f"{path.name}: {n}" for n in columns if n not in (reading, reference)]
    return draft


def _numbers(table: Table, name: str) -> np.ndarray | None:
    """A column (N,) of enough numbers that is no time."""
    values = None if is_time(name) else numbers_of(table, name)
    if values is None or values.ndim != 1 or np.isfinite(values).sum() < LEAST:
        return None
    return values


def _says_depth(name: str) -> bool:
    return bool(set(words_in(name)) & DEPTH)


def _says_truth(name: str) -> bool:
    words = set(words_in(name))
    return bool(words & TRUTH) and not words & GIVEN


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < LEAST or np.ptp(a[both]) == 0.0 or np.ptp(b[both]) == 0.0:
        return False
    return float(np.corrcoef(a[both], b[both])[0, 1]) > ALIKE


def _listed(pairs: Sequence[tuple[str, str]]) -> str:
    return " or ".join(f"{a!r} against {b!r}" for a, b in pairs)
