"""Drafts a mapping of readings: which column the sensor gave, which is the truth, in which unit.

Nothing but names says which of two columns is the truth: a factor of 1.01 is 0.99 the other way round. Metres
show in the numbers, since no depth camera measures 100 m; between cm and mm a name must decide.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import is_time, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.readings.clock_draft import COUNTERS, describe_clocks, find_clocks
from samrl_ros.log_import.draft.readings.trial_columns import Trials, find_trials, is_flat, numbered_names
from samrl_ros.log_import.draft.text_layout import stated_options
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTable
from samrl_ros.log_import.pose_specs import LENGTHS
from samrl_ros.log_import.table import Table

DEPTH = frozenset("depth range tof lidar sonar ultrasonic realsense kinect".split())
_SENSORS = re.compile(r"vl(?:53l|6180)\w*|hcsr04|hc[-_ ]sr04|gp2y\w*|d4[0-9]5i?", re.IGNORECASE)
_LETTERS = re.compile(r"[a-z]+")
_ZONE = re.compile(r"(.*?)[ _.\[(]*(\d+)[\])]?")  # zone_0, depth[12]
ZONES = frozenset("zone zones pixel px spad beam cell roi depth range".split())
LEAST_ZONES = 4  # columns of one name and a number
TRUTH = frozenset("true truth reference ref gt groundtruth ground actual laser plane distance".split())
TRUTH |= frozenset("tape ruler caliper expected known".split())
GIVEN = frozenset("measured raw reading sensor camera cam estimated est".split())
FARTHEST, NEAREST = 30.0, 0.05  # [m] that depth cameras measure
ALIKE = 0.9  # correlation of a reading with its reference
FARTHEST_OFF = 2.0  # factor by which a depth is off its reference
FEWEST = 6  # distances: fewer say nothing, and are no log of depth


def draft_readings(tables: Sequence[LoggedTable]) -> Draft | None:
    """A draft of tables that hold a depth and its reference, or two clocks; None of any other log.

    Several tables must be alike: runs of one sensor, of which the last is held out.
    """
    if not tables or any(each.part for each in tables):
        return None
    first = tables[0].table
    columns = {name: v for name in first.columns if (v := _numbers(first, name)) is not None}
    stated = [name for name in first.columns if says_truth(name) and is_flat(first, name)]
    trials = find_trials(first, stated)
    if trials is None and len(tables) == 1:
        _refuse_means(first, stated)
    true = [name for name in columns if says_truth(name)]
    counts = {name for name in columns if COUNTERS & set(words_in(name.rpartition(".")[2]))}
    read = [name for name in columns if _says_depth(name) and not says_truth(name) and name not in counts]
    read = read or [name for name in columns if _says_measured_length(name)]
    zones = _zones([name for name in columns if not says_truth(name)])
    read = zones[len(zones) // 2 :][:1] or read
    unsaid = not read and len(columns) == len(tables[0].table.columns) == 2
    if unsaid:  # `expected,measured`, without a time beside, which a log of a controlled joint has
        read = [name for name in columns if GIVEN & set(words_in(name))]
    pairs = [(a, b) for a in read for b in true if trials is None and _alike(columns[a], columns[b])]
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    if trials is not None:
        used = _describe_trials(first, trials, draft)
    elif pairs:
        used = _describe_depth(columns, pairs, draft)
        if zones:
            draft.note(
                "readings", f"{len(zones)} zones, {zones[0]!r} to {zones[-1]!r}, read the same distance",
                f"is it {used[0]!r} in the middle that is to be judged? One reading is compared at a time",
            )  # fmt: skip
        if unsaid:
            why = f"neither {used[0]!r} nor {used[1]!r} says of what"
            draft.note("readings", why, "are they a sensor's distances, in this unit?")
    elif clocks := find_clocks(tables[0].table):
        used = describe_clocks(clocks, [each.table for each in tables if clocks.are_in(each.table)], draft)
    else:
        return None
    if any(not set(used) <= set(each.table.columns) for each in tables):
        return None
    source: dict[str, Any] = {"file": tables[0].path.name}
    if stated := stated_options(tables[0].csv):
        source["csv"] = stated
    draft.sources["log"] |= source
    if pairs and any((each.table.numbers(used[0], "the log") == 0.0).any() for each in tables):
        draft.sources["log"]["columns"]["reading"] = {"column": used[0], "empty": 0.0}
        draft.sources["log"]["missing"] = "drop_row"
        draft.note("sources.log.columns", f"{used[0]!r} is exactly zero at times: nothing was seen there")
    if any(np.isnan(each.table.numbers(name, "the log")).any() for each in tables for name in used):
        draft.sources["log"]["missing"] = "drop_row" if trials is None else "drop_cell"
    paths = [each.path for each in tables]
    draft.recordings = [{"name": path.stem, "role": "fit"} for path in paths]
    if len(paths) > 1:
        draft.sources["log"]["file"] = f"{{name}}{paths[0].suffix}"
        draft.recordings[-1]["role"] = "held_out"
        draft.note("recordings", "files with the same columns: one sensor's; the last by name is held out")
    draft.unused += [f"{paths[0].name}: {n}" for n in columns if n not in used]
    return draft


def _describe_depth(
    columns: dict[str, np.ndarray], pairs: list[tuple[str, str]], draft: Draft
) -> tuple[str, str]:
    """Roles and unit; the columns used."""
    reading, reference = pairs[0]
    several = len(pairs) > 1
    draft.note(
        "readings",
        f"{reading!r} is what the sensor gave, {reference!r} how far it was: by their names",
        f"is it {reading!r} against {reference!r}, and not {_listed(pairs[1:])}?" if several else "",
    )
    both = np.isfinite(columns[reading]) & np.isfinite(columns[reference]) & (columns[reading] != 0.0)
    typical = float(np.median(columns[reference][both]))
    known = [unit for unit, factor in LENGTHS.items() if NEAREST < factor * typical < FARTHEST]
    said = [unit for unit in known if unit in {w for n in (reading, reference) for w in words_in(n)}]
    unit = (said or known or ["m"])[0]
    why = "by their names" if said else f"half of the distances are beyond {typical:.4g}"
    others = " or ".join(each for each in known if each != unit) or "another"
    question = "" if said or known == [unit] else f"is the unit {unit}, and not {others}?"
    draft.note("readings", f"in {unit}: {why}", question)
    formulas = ["reading", "reference"]
    own = [next((u for u in LENGTHS if u in words_in(name)), unit) for name in (reading, reference)]
    if own[0] != own[1]:
        formulas = [f"{LENGTHS[u]:g} * {f}" for u, f in zip(own, formulas, strict=True)]
        unit = "m"
        draft.note("readings", f"{reading!r} in {own[0]} and {reference!r} in {own[1]} are both taken to m")
    by = [LENGTHS[u] for u in own]
    share = float(np.median(by[0] * columns[reading][both])) / max(by[1] * abs(typical), 1e-12)
    if not 1.0 / FARTHEST_OFF < share < FARTHEST_OFF:
        draft.note(
            "readings", f"{reading!r} is {share:.4g} times {reference!r}",
            "no depth is off by so much: in which units are the two? Write a factor into the formula",
        )  # fmt: skip
    draft.sources["log"] = {"columns": {"reading": reading, "reference": reference}}
    draft.readings = {"quantity": "depth", "reading": formulas[0], "reference": formulas[1], "unit": unit}
    return reading, reference


def _describe_trials(table: Table, trials: Trials, draft: Draft) -> tuple[str, ...]:
    """Every trial of a row is a reading of its distance; the columns used."""
    means = {trials.label: trials.means(table), trials.reference: table.numbers(trials.reference, "the log")}
    _describe_depth(means, [(trials.label, trials.reference)], draft)
    names = {f"trial_{k}": name for k, name in enumerate(trials.names)}
    draft.sources["log"]["columns"] = {**names, "reference": trials.reference}
    formula = draft.readings["reading"].replace("reading", f"stack({', '.join(names)})")
    draft.readings["reading"] = formula
    draft.note(
        "readings", f"{len(names)} columns, {trials.label}, hold readings of one distance in each row",
        "" if _says_depth(trials.label) else "are they a sensor's distances, in this unit?",
    )  # fmt: skip
    return (*trials.names, trials.reference)


def _refuse_means(table: Table, stated: Sequence[str]) -> None:
    """Raises `InputError` of a few distances beside as many readings, which are means or single ones."""
    read = [name for name in table.columns if name not in stated and is_flat(table, name)]
    read = [name for name in read if _says_depth(name) or _says_measured_length(name)]
    rows = max((len(table.numbers(name, "the log")) for name in stated), default=0)
    if read and 0 < rows < FEWEST:
        raise InputError(
            f"{table.path.name} holds {rows} rows of {read[0]!r} beside {stated[0]!r}: too few to tell a"
            " factor from noise. Give every reading, and not their mean, twenty or more in all at three"
            " distances: a row for each, distance_mm,depth_mm, or side by side, distance_mm,trial_1,trial_2"
        )


def _numbers(table: Table, name: str) -> np.ndarray | None:
    """A column (N,) of enough numbers that is no time."""
    values = None if is_time(name) else numbers_of(table, name)
    if values is None or values.ndim != 1 or np.isfinite(values).sum() < FEWEST:
        return None
    return values


def _zones(names: Sequence[str]) -> list[str]:
    """Columns of one name and a number, in its order, that many sensors' zones have; else none."""
    found = numbered_names(names, _ZONE, ZONES)
    return found if len(found) >= LEAST_ZONES else []


def _says_depth(name: str) -> bool:
    as_written = set(_LETTERS.findall(name.lower()))  # `ToF` is one word, not `to` and `f`
    return bool((set(words_in(name)) | as_written) & DEPTH) or _SENSORS.search(name) is not None


def _says_measured_length(name: str) -> bool:
    """Whether a name says that it was measured, and in a unit of length: `Measured (cm)`."""
    words = set(words_in(name))
    return bool(words & GIVEN) and bool(words & set(LENGTHS))


def says_truth(name: str) -> bool:
    """Whether a name is of what is trusted."""
    words = set(words_in(name))
    return bool(words & TRUTH) and not words & GIVEN


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    both = np.isfinite(a) & np.isfinite(b) & (a != 0.0)  # where nothing was seen
    if both.sum() < FEWEST or np.ptp(a[both]) == 0.0 or np.ptp(b[both]) == 0.0:
        return False
    return float(np.corrcoef(a[both], b[both])[0, 1]) > ALIKE


def _listed(pairs: Sequence[tuple[str, str]]) -> str:
    return " or ".join(f"{a!r} against {b!r}" for a, b in pairs)
