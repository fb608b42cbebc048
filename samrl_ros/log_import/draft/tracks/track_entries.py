"""What drafts of poses and of bodies share: sources, their time, and how columns form a track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_ros.log_import.draft import evidence
from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.column_names import meaning, words_in
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.split_stamp import frame_counter, split_stamp
from samrl_ros.log_import.draft.text_layout import stated_options
from samrl_ros.log_import.draft.tracks.found_track import Component
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.pose_tracks import numbers_of_parts, time_columns
from samrl_ros.log_import.formats.views import name_of_file
from samrl_ros.log_import.sources import SourceData
from samrl_ros.log_import.table import Table

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
INCH_M = 0.0254
FAR = 20.0  # of a position: no arm, camera or tossed body is so far off in metres
FULL_TURN = 2.0 * np.pi + 0.1


@dataclass(frozen=True, eq=False)
class FoundTime:
    """Where the time of a table stands, and which units are possible."""

    entry: dict[str, Any]  # of the mapping, without its unit; empty: the file's own
    values: np.ndarray  # (N,) as logged
    units: tuple[str, ...]  # the likeliest first
    proof: str  # what says it; empty where only the steps do

    def seconds(self, unit: str) -> np.ndarray:
        """(N,) [s] if it is in this unit."""
        return self.values * SECONDS[unit]


def find_time(each: LoggedTrack, used: Sequence[str]) -> FoundTime | None:
    """The time of a track's table; None where no column is named as one.

    Args:
        each: the track.
        used: columns of poses.
    """
    table = each.table
    if table.time is not None:
        return FoundTime({}, table.time, ("s",), "the log's own")
    if (own := each.track.time) is not None:
        values = numbers_of_parts(table, [own])[:, 0]
        steps = np.diff(values[np.isfinite(values)])
        entry = {"column": f"{own.column}[{own.index}]"}
        return FoundTime(entry, values, tuple(evidence.time_unit(steps)) or ("s",), "")
    names = time_columns(table, list(used))
    if not each.track.named:
        names = [name for name in table.columns if name not in used and _runs_on(table, name)][:1]
    for name in names:
        values = numbers_of(table, name)
        if values is None:
            moments = table.times(name, "the log")
            return FoundTime({"column": name, "iso": True}, moments, ("s",), f"{name!r} holds dates")
        if split := split_stamp(table, name):
            return FoundTime(split.entry, split.seconds, ("s",), split.proof)

    # Of several clocks the header's stamp tells when something was seen, the others when it was written; a
    # column whose name has a unit is no count of rows.
    def rank(name: str) -> tuple[bool, bool]:
        return not {"stamp", "timestamp"} & set(words_in(name)), meaning(name).unit not in SECONDS

    for name in sorted(names, key=rank):
        values = numbers_of(table, name)
        if values is None or values.ndim != 1:
            continue
        said = meaning(name).unit
        if said in SECONDS:
            return FoundTime({"column": name}, values, (said,), f"{name!r}: its name says {said}")
        steps = np.diff(values[np.isfinite(values)])
        if len(steps) and np.median(steps) > 0:
            return FoundTime({"column": name}, values, tuple(evidence.time_unit(steps)) or ("s",), "")
    return None


def repeats_time(found: FoundTime) -> int:
    """How many steps of a time do not increase, as where a logger wrote a row twice."""
    return int((np.diff(found.values[np.isfinite(found.values)]) <= 0).sum())


def _runs_on(table: Table, name: str) -> bool:
    """Whether a column without a name can be a clock: it never goes back, and stands still in few steps.

    Stamps that are rounded to 10 ms, and rows that a logger wrote twice, repeat.
    """
    values = numbers_of(table, name)
    if values is None or values.ndim != 1:
        return False
    steps = np.diff(values)
    return bool((steps >= 0).all() and evidence.runs_on(values) == 2)


def find_frames(each: LoggedTrack, used: Sequence[str]) -> str:
    """A column that counts frames; empty where there is none."""
    return frame_counter(each.table, used)


def add_track_source(key: str, each: LoggedTrack, draft: Draft) -> dict[str, Any]:
    """The file of a track as a source of the draft, without its time."""
    source: dict[str, Any] = {"file": name_of_file(each.path)}
    if each.part:
        source["part"] = each.part
    if stated := stated_options(each.csv):
        source["csv"] = stated
    source["columns"] = {}
    draft.sources[key] = source
    return source


def add_columns(parts: Sequence[Component], source: dict[str, Any]) -> list[str]:
    """Formulas of components; their columns are added to the source under names for formulas."""
    columns: dict[str, Any] = source["columns"]
    formulas = []
    for part in parts:
        short = next((k for k, v in columns.items() if part.column in (v, _column_of(v))), "")
        if not short:
            short = "".join(c if c.isascii() and c.isalnum() else "_" for c in part.column).strip("_")
            short = short if short.isidentifier() and short != "time" else f"c_{short}"
            while short in columns:
                short += "_"
            columns[short] = part.column
        formulas.append(short if part.index is None else f"{short}[{part.index}]")
    return formulas


def add_track_entry(each: LoggedTrack, key: str, draft: Draft) -> dict[str, Any]:
    """A track as the mapping names it, as far as its own names and numbers say."""
    source = draft.sources[key]
    entry: dict[str, Any] = {"source": key}
    for kind, parts in each.track.columns.items():
        if kind not in ("position", each.track.rotation):
            continue
        formulas = add_columns(parts, source)
        entry[kind] = formulas if len(formulas) > 1 or parts[0].index is not None else formulas[0]
    if each.track.unit == "in":
        entry["position"] = [f"{INCH_M} * {formula}" for formula in _listed(entry["position"])]
    entry["unit"] = length_unit(each)
    if each.track.rotation in ("rpy", "rotation_vector"):
        entry["angle_unit"] = each.track.angle_unit or turns_unit(each)
    if not np.isfinite(track_numbers(each)).all():
        source["missing"] = "drop_row"
    if each.track.zeros:
        empty_columns(each, source)
        draft.note(
            f"sources.{key}.columns",
            f"{each.track.zeros} poses are exactly zero amid others: lost frames, which are left out",
        )
    return entry


def turns_unit(each: LoggedTrack) -> str:
    """Of angles that no name says: degrees where they go beyond a turn in radians."""
    turned = numbers_of_parts(each.table, each.track.columns[each.track.rotation])
    return "deg" if float(np.nanmax(np.abs(turned))) > FULL_TURN else "rad"


def empty_columns(each: LoggedTrack, source: dict[str, Any]) -> None:
    """States that zeros of a track's position are empty cells."""
    columns = {part.column for part in each.track.columns["position"]}
    for short, entry in source["columns"].items():
        if (column := _column_of(entry)) in columns:
            source["columns"][short] = {"column": column, "empty": 0.0}


def length_unit(each: LoggedTrack) -> str:
    """Of a position: what its names say, else what its size suggests."""
    if each.track.unit in ("m", "cm", "mm"):
        return each.track.unit
    if each.track.unit == "in":
        return "m"  # by a formula
    return "mm" if float(np.nanmax(np.abs(each.position))) > FAR else "m"


def track_numbers(each: LoggedTrack) -> np.ndarray:
    """All numbers (N, K) of a track."""
    kinds = ("position", each.track.rotation)
    return np.concatenate(
        [numbers_of_parts(each.table, parts) for kind, parts in each.track.columns.items() if kind in kinds],
        axis=1,
    )


def rotation_readings(each: LoggedTrack, entry: dict[str, Any]) -> list[tuple[dict[str, Any], str]]:
    """Entries that the log leaves open by how its rotation is meant, each with words for it.

    Args:
        each: the track.
        entry: of the mapping; the first of those returned, with what was open.
    """
    if each.track.rotation == "quaternion":
        orders = (each.track.order,) if each.track.order else ("xyzw", "wxyz")
        return [({**entry, "order": order}, f"{order} quaternions") for order in orders]
    if each.track.vague:
        orders = [(entry, "")] if each.track.named else [(entry, ""), (_angles_first(each, entry), " first")]
        found = []
        for one, first in orders:
            rest = {key: value for key, value in one.items() if key != "rotation_vector"}
            found.append((one, f"rotation vectors{first}"))
            found.append(({**rest, "rpy": one["rotation_vector"]}, f"roll, pitch and yaw{first}"))
        return found
    return [(entry, "")]


def _angles_first(each: LoggedTrack, entry: dict[str, Any]) -> dict[str, Any]:
    """Six numbers without names, read as a rotation and then a position."""
    parts = each.track.columns
    turned = numbers_of_parts(each.table, parts["position"])
    moved = numbers_of_parts(each.table, parts["rotation_vector"])
    return {
        **entry,
        "position": entry["rotation_vector"],
        "rotation_vector": entry["position"],
        "unit": "mm" if float(np.nanmax(np.abs(moved))) > FAR else "m",
        "angle_unit": "deg" if float(np.nanmax(np.abs(turned))) > FULL_TURN else "rad",
    }


def source_data(tracks: Sequence[LoggedTrack], source: dict[str, Any], time: np.ndarray) -> SourceData:
    """What `read_source` would give for tracks of one table, without reading it again.

    Args:
        tracks: of one table.
        source: of the draft.
        time: (N,) [s] of its rows.
    """
    table = tracks[0].table
    values = {
        short: np.asarray(table.numbers(_column_of(column), "the log"))
        for short, column in source["columns"].items()
    }
    keep = np.isfinite(time)
    for column in values.values():
        keep &= np.isfinite(column if column.ndim == 1 else column.sum(axis=1))
    ahead = np.maximum.accumulate(np.where(keep, time, -np.inf))
    keep &= time > np.concatenate([[-np.inf], ahead[:-1]])
    return SourceData((), time[keep], {short: column[keep] for short, column in values.items()})


def _column_of(entry: str | dict[str, Any]) -> str:
    """A column as the source names it, whatever else stands there."""
    return entry if isinstance(entry, str) else str(entry["column"])


def every_nth(data: SourceData, most: int) -> SourceData:
    """At most so many of its rows, evenly."""
    step = max(1, -(-len(data.time) // most))
    return SourceData(data.files, data.time[::step], {name: v[::step] for name, v in data.values.items()})


def _listed(formulas: list[str] | str) -> list[str]:
    return formulas if isinstance(formulas, list) else [formulas]
