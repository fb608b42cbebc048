"""Drafts of stamps: two clocks in a table, frames that are counted, headers of a bag against its recorder.

Two clocks that stamp the same events are told by their names and by running alike. Where they do not count
from the same moment, or one tells when a message came in, their offset says nothing, and the rate is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.blocks import ROS_TYPES, numbers_of
from samrl_ros.log_import.draft.column_names import is_time, meaning, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.split_stamp import SplitStamp, split_stamp
from samrl_ros.log_import.draft.tracks.track_entries import SECONDS
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table

LEAST = 50  # stamps of two clocks
ARRIVAL = frozenset("receive received recv arrival arrived bag log".split())
HOST = ARRIVAL | frozenset("trigger host system pc ptp local ros reference ref".split())
DEVICE = frozenset("device camera cam sensor hardware hw header exposure image imu driver mcu robot".split())
COUNTERS = frozenset("frame frames seq index id number count".split())
RUNS_ALIKE = 0.999  # correlation of two clocks
RATES = frozenset("hz freq frequency rate".split())
SAME_RATE = 0.02  # by which no clock is off that is in the unit, or counts the ticks, that it is said to
FAR_APART_S = 5.0  # that no clock is off, which counts from the same moment
EPOCH_S = 1e8  # since 1970, beyond which a clock tells the date
TRANSPORT_S = 0.05  # by which a message may arrive after what it tells
USUAL_RATES_HZ = (10, 15, 20, 24, 25, 30, 50, 60, 90, 100, 120, 125, 200, 240, 250, 400, 500, 1000)
STAMPED = frozenset(
    f"sensor_msgs/msg/{name}"
    for name in (
        "Image CompressedImage CameraInfo Imu LaserScan PointCloud2 Range MagneticField FluidPressure"
        " Temperature NavSatFix Joy"
    ).split()
) | frozenset(f"geometry_msgs/msg/{name}Stamped" for name in ("Wrench", "Twist", "Accel", "Vector3"))


@dataclass(frozen=True)
class Clocks:
    """Columns of one table that stamp the same events."""

    device: str  # its stamps, or the number of the frame
    host: str
    counts: bool = False  # the device's column counts frames
    arrives: bool = False  # the host tells when a message came in

    def are_in(self, table: Table) -> bool:
        """Whether a table has both columns."""
        return {self.device, self.host} <= set(table.columns)


def find_clocks(table: Table) -> Clocks | None:
    """Stamps of the same events, by their names, in a table that holds little else.

    What stays as it is (a gain, an exposure) is a setting, and a time that does not run on is a duration.
    """
    stamps: dict[str, np.ndarray] = {}
    counters: dict[str, np.ndarray] = {}
    rests = {split.rest for name in table.columns if (split := split_stamp(table, name)) is not None}
    for name in table.columns:
        values = None if name in rests else _stamps_in(table, name)
        if values is None or values.ndim != 1 or np.isfinite(values).sum() < LEAST:
            continue
        if np.nanmin(values) == np.nanmax(values) or (is_time(name) and not evidence.runs_on(values)):
            continue
        words = set(words_in(name))
        if words & COUNTERS and not is_time(name):
            counters[name] = values
        elif is_time(name) or words & (HOST | DEVICE):
            stamps[name] = values
        else:
            return None
    device = [n for n in stamps if set(words_in(n)) & DEVICE and not set(words_in(n)) & HOST]
    host = [n for n in stamps if set(words_in(n)) & HOST]
    host = host or [n for n in stamps if n not in device and n.startswith("%")]  # `rostopic echo -p`
    counted = [n for n, v in counters.items() if _counts_frames(v)]
    if len(device) == len(host) == 1 == len(stamps) - 1 and _run_alike(stamps[device[0]], stamps[host[0]]):
        words = set(words_in(host[0]))
        return Clocks(device[0], host[0], arrives=bool(words & ARRIVAL) or host[0].startswith("%"))
    if len(stamps) == len(counted) == 1:
        (clock, time), (number,) = next(iter(stamps.items())), counted
        if _run_alike(counters[number], time):
            return Clocks(number, clock, counts=True)
    return None


def describe_clocks(clocks: Clocks, tables: Sequence[Table], draft: Draft) -> tuple[str, ...]:
    """Roles and units of two clocks of the first table, with the others alike; the columns used."""
    device, host = clocks.device, clocks.host
    values = {name: _read_stamps(tables[0], name) for name in (device, host)}
    split = {name: split_stamp(tables[0], name) for name in (device, host)}
    units = {host: _unit(host, values[host], split[host], draft)}
    by = {host: SECONDS[units[host]]}
    runs = _counts_per_second(values[device], by[host] * values[host])
    if clocks.counts:
        usual = min(USUAL_RATES_HZ, key=lambda each: abs(np.log(each / runs)))
        by[device], units[device] = 1.0 / usual, ""
        draft.note(
            "readings", f"{device!r} counts frames, {runs:.6g} in a second of {host!r}",
            f"at how many frames per second is the sensor said to run? {usual} stands in `reading`",
        )  # fmt: skip
    else:
        draft.note("readings", f"{device!r} are a device's stamps, {host!r} another clock's: by their names")
        units[device] = _unit(device, values[device], split[device], draft, host, runs)
        if not units[device]:
            by[device] = 1.0 / _ticks_per_second(clocks, tables, runs, draft)
        else:
            by[device] = SECONDS[units[device]]
    shift = _shift(by, clocks, tables, draft)
    columns = {"device": device, "host": host}
    names = dict.fromkeys(columns, "")
    for role, column in list(columns.items()):
        names[role] = role
        if (two := split[column]) is not None:
            columns[f"{role}_rest"] = two.rest
            names[role] = f"({role} + {two.unit:g} * {role}_rest)"
    formulas = [names["device"], names["host"]]
    unit = units[host]
    if units[device] != units[host] or shift:
        own = _in_seconds(by[device], formulas[0])
        if not units[device]:
            own = f"{formulas[0]} / {round(1.0 / by[device])}"
        formulas = [f"{own} + {shift!r}" if shift else own, _in_seconds(by[host], formulas[1])]
        unit = "s"
    two = split[host]
    clock = {"column": host, "unit": units[host]} if two is None else dict(two.entry)
    draft.sources["log"] = {"time": clock, "columns": columns}
    time = values[host][np.isfinite(values[host])]
    if (np.diff(time) <= 0).any():
        draft.sources["log"]["time"]["repeated"] = "drop"
    draft.readings = {"quantity": "stamp", "reading": formulas[0], "reference": formulas[1], "unit": unit}
    return tuple(columns.values())


def draft_stamped_topic(paths: Sequence[Path]) -> Draft | None:
    """A draft of a bag's stamped messages against its recorder's clock; None where there are none.

    Raises:
        InputError: a bag that cannot be read.
    """
    if not paths or not all(is_bag(path) for path in paths):
        return None
    topics = list_topics(paths[0], "the log")
    if any(topic.type in ROS_TYPES for topic in topics):
        return None  # a machine's, whose joints say more
    found = [topic for topic in topics if topic.type in STAMPED and topic.count >= LEAST]
    tables: list[tuple[str, list[Table]]] = []
    for topic in sorted(found, key=lambda t: -t.count):
        try:
            read = [read_table(path, CsvOptions(), "the log", topic.name) for path in paths]
        except InputError:
            continue  # a bag without that topic
        if all(isinstance(s := t.columns.get("header.stamp"), np.ndarray) and s.any() for t in read):
            tables.append((topic.name, read))
    if not tables:
        return None
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    name, read = tables[0]
    describe_clocks(Clocks("header.stamp", "log_time", arrives=True), read, draft)
    if others := " or ".join(name for name, _ in tables[1:]):
        draft.note("sources.log", f"{name} has most messages", f"is it {name}, and not {others}?")
    draft.sources["log"] |= {"file": paths[0].name, "part": name}
    draft.readings["sensor"] = name.strip("/").split("/")[0] or "camera"
    draft.recordings = [{"name": path.stem, "role": "fit"} for path in paths]
    if len(paths) > 1:
        for path, entry in zip(paths, draft.recordings, strict=True):
            entry["files"] = {"log": path.name}
        draft.recordings[-1]["role"] = "held_out"
    return draft


def _stamps_in(table: Table, name: str) -> np.ndarray | None:
    """A column of numbers; of a stamp's whole seconds the stamp with its rest [s]."""
    split = split_stamp(table, name)
    return numbers_of(table, name) if split is None else split.seconds


def _read_stamps(table: Table, name: str) -> np.ndarray:
    """The same of a column that holds some."""
    split = split_stamp(table, name)
    return np.asarray(table.numbers(name, "the log")) if split is None else split.seconds


def _in_seconds(factor: float, formula: str) -> str:
    return formula if factor == 1.0 else f"{factor:g} * {formula}"


def _unit(
    name: str, values: np.ndarray, split: SplitStamp | None, draft: Draft, host: str = "", runs: float = 0.0
) -> str:
    """In which a clock's stamps are: by its name, by the other clock, or by its steps; empty for ticks.

    Args:
        name: of its column.
        values: (N,) its stamps.
        split: its whole seconds and their rest, where they stand in two columns.
        draft: gets the proof.
        host: the other clock, whose unit is known; empty where there is none yet.
        runs: by how much this one grows in a second of the other.
    """
    if split is not None:
        draft.note("readings", f"{split.proof} are one stamp")
        return "s"
    said, found = meaning(name).unit, evidence.time_unit(np.diff(values[np.isfinite(values)]))
    if name.startswith(("header.stamp", "log_time")):
        said = "s"  # of a bag's messages
    if said in SECONDS:
        apart = runs * SECONDS[said] if host else 1.0
        question = "" if abs(apart - 1.0) < SAME_RATE else (
            f"is {name!r} in {said}? {host!r} runs {1.0 / apart:.4g} times as fast then"
        )  # fmt: skip
        draft.note("readings", f"{name!r} in {said}: its name", question)
        return said
    if host:
        unit = next((each for each, s in SECONDS.items() if abs(runs * s - 1.0) < SAME_RATE), "")
        if unit:
            draft.note("readings", f"{name!r} in {unit}: it runs as {host!r} does")
        return unit
    unit = (found or ["s"])[0]
    draft.note("readings", f"{name!r} in {unit}: its steps", f"is {name!r} in {unit}?" * (len(found) != 1))
    return unit


def _counts_per_second(counts: np.ndarray, seconds: np.ndarray) -> float:
    """By how much a device's column (N,) grows in a second of the other clock's stamps (N,) [s]."""
    both = np.isfinite(counts) & np.isfinite(seconds)
    since = seconds[both] - seconds[both][0]
    return float(np.polyfit(since, counts[both] - counts[both][0], 1)[0])


def _ticks_per_second(clocks: Clocks, tables: Sequence[Table], runs: float, draft: Draft) -> float:
    """How many ticks a device's clock is said to count in a second: by a column beside it, else asked for."""
    told = {}
    for table in tables:
        for name in table.columns:
            values = numbers_of(table, name) if set(words_in(name)) & RATES else None
            if (
                values is not None
                and values.ndim == 1
                and len(seen := np.unique(values[np.isfinite(values)])) == 1
            ):
                told.setdefault(name, set()).add(float(seen[0]))
    stated = {name: min(rates) for name, rates in told.items() if len(rates) == 1}
    near = [name for name, rate in stated.items() if abs(runs / rate - 1.0) < SAME_RATE]
    counted = f"{clocks.device!r} counts ticks, {runs:.9g} in a second of {clocks.host!r}"
    if len(near) == 1:
        draft.note("readings", f"{counted}; {near[0]!r} states {stated[near[0]]:.9g}")
        return stated[near[0]]
    usual = float(f"{runs:.3g}")
    draft.note(
        "readings", counted,
        f"at how many ticks per second is its clock said to run? {usual:.9g} stands in `reading`",
    )  # fmt: skip
    return usual


def _shift(by: dict[str, float], clocks: Clocks, tables: Sequence[Table], draft: Draft) -> float:
    """Seconds that take a device's clock to the host's where their offset says nothing; else 0."""
    apart, dates = [], []
    for table in tables:
        a, b = (by[name] * _read_stamps(table, name) for name in (clocks.device, clocks.host))
        both = np.flatnonzero(np.isfinite(a) & np.isfinite(b))[:LEAST]
        apart.append(round(float(np.median(b[both] - a[both])), 6))
        dates.append(float(min(a[both[0]], b[both[0]])) > EPOCH_S)
    off = -apart[0]
    if clocks.counts or (abs(off) > FAR_APART_S and not all(dates)):
        why = f"the clocks count from different moments, {-off:.6g} s apart: their offset says nothing"
    elif clocks.arrives and -TRANSPORT_S < off <= 0.0:
        why = f"{clocks.host!r} tells when a message came in, {-off:.2g} s after its stamp: its way may be it"
    else:
        if abs(off) > FAR_APART_S:
            draft.note(
                "readings", f"the clocks are {off:.6g} s apart, and both tell the date",
                "is one of them off by so much? If it is known, subtract it in `reading`",
            )  # fmt: skip
        return 0.0
    restarted = float(np.ptp(apart)) > TRANSPORT_S
    draft.note(
        "readings", f"{why}; it is taken out at the beginning, and the rate is told",
        "their offset changes between the files: diagnose one at a time" if restarted else "",
    )  # fmt: skip
    draft.tolerances["stamp"] = TRANSPORT_S
    return apart[0]


def _counts_frames(values: np.ndarray) -> bool:
    """Whether a column counts up by whole numbers."""
    steps = np.diff(values)
    return bool(np.isfinite(values).all() and (values == np.round(values)).all() and (steps > 0).all())


def _run_alike(a: np.ndarray, b: np.ndarray) -> bool:
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < LEAST or np.ptp(a[both]) == 0.0 or np.ptp(b[both]) == 0.0:
        return False
    return float(np.corrcoef(a[both], b[both])[0, 1]) > RUNS_ALIKE
