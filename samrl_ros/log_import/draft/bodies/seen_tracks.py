"""What the tracks of a log show of a free body: which one moves, which one falls, and what it touches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.residuals.bodies.phase_search import CONTACT, find_phases
from samrl_ros.log_import.draft.blocks import numbers_of
from samrl_ros.log_import.draft.bodies.free_fall import FreeFall, G, find_free_fall, find_unscaled_fall
from samrl_ros.log_import.draft.column_names import meaning, words_in
from samrl_ros.log_import.draft.tracks.logged_tracks import SHARED, LoggedTrack
from samrl_ros.log_import.draft.tracks.pose_tracks import RATES
from samrl_ros.log_import.draft.tracks.track_entries import (
    FAR,
    INCH_M,
    SECONDS,
    FoundTime,
    find_frames,
    find_time,
)
from samrl_ros.log_import.pose_specs import LENGTHS

BODIES = frozenset(
    "puck ball block cube body object box disc disk projectile marker slider brick toss bounce drop".split()
)
JOINTS = frozenset("joint joints motor motors axis servo servos actuator".split())
STILL = 0.02  # of the way of the track that goes farthest: what goes less stands still
FLAT = 0.2  # of the next narrower width of a track, up to which it stays in a plane
MOST_POSES = 3000  # of a track that are looked at
LEAST_POSES = 8
WIDEST_M = 8.0  # box that a track stays in, beyond which a unit is not proven by what looks like a fall
SLIDES_S, SLIDES_M = 0.12, 0.01  # that a body keeps contact and goes, for it to be a slide
DATED = 1000.0  # lengths of a log, since which a clock has run that was not set to zero for it
FRAME_RATES = (30.0, 60.0, 120.0, 240.0)  # [Hz] that cameras have


@dataclass(frozen=True, eq=False)
class SeenTrack:
    """A track with the time that its table gives."""

    each: LoggedTrack
    time: FoundTime | None
    frames: str  # a column that counts them, where there is no time
    fall: FreeFall | None
    curve: tuple[int, int] | None = None  # axis and up of what falls in units that nothing tells

    @property
    def way(self) -> float:
        """Diagonal of the box that it stays in, as logged."""
        return float(
            np.linalg.norm(np.nanmax(self.each.position, axis=0) - np.nanmin(self.each.position, axis=0))
        )


def is_of_a_machine(each: LoggedTrack, tracks: Sequence[LoggedTrack]) -> bool:
    """Whether joints, commands or efforts stand beside it: then it is a tool's or an axis'."""
    used = {name for other in tracks if other.table is each.table for name in other.track.used}
    rest = [
        name for name in each.table.columns if name not in used and numbers_of(each.table, name) is not None
    ]
    if each.words & JOINTS:
        return True
    if each.part:
        return False
    angles = 0
    for name in rest:
        told = meaning(name)
        if told.commanded or told.quantity in ("effort", "current", "voltage"):
            return True
        rate = set(words_in(name)) & RATES  # an IMU's, or of a trajectory's own
        angles += told.quantity == "position" and "frame" not in words_in(name) and not rate
    return angles > (len(each.track.axes) == 2)


def are_at_once(tracks: Sequence[LoggedTrack]) -> bool:
    """Whether poses of two files share one stretch of dates: two devices, and no two motions of one body."""
    spans = []
    for each in tracks:
        if each.track.whole and (time := find_time(each, each.track.used)) is not None:
            first, last = np.nanmin(time.values), np.nanmax(time.values)
            spans.append((first, last, each.path))
    spans = [span for span in spans if span[0] > DATED * (span[1] - span[0])]
    return any(
        min(a[1], b[1]) - max(a[0], b[0]) > SHARED * min(a[1] - a[0], b[1] - b[0])
        for k, a in enumerate(spans)
        for b in spans[:k]
        if a[2] != b[2]
    )


def is_named_body(each: LoggedTrack) -> bool:
    """Whether a name says that it is a free body."""
    return bool((each.words | set(words_in(each.path.stem))) & BODIES)


def stands_still(each: LoggedTrack, tracks: Sequence[LoggedTrack]) -> bool:
    """Whether what a row's label names stays where it is while another thing of that file moves.

    A table's tag does. A few poses may stand apart, as a detector gives them.
    """
    if not each.csv.label:
        return False
    ways = [np.linalg.norm(_widths(other)) for other in tracks if other.motion == each.motion]
    return bool(np.linalg.norm(_widths(each)) < STILL * max(ways))


def _widths(each: LoggedTrack) -> np.ndarray:
    """Along each axis (2,) or (3,), of the box that all but a few poses of a track lie in."""
    low, high = np.nanpercentile(each.position, [2, 98], axis=0)
    return high - low


def look_at(each: LoggedTrack) -> SeenTrack:
    """A track with its time, and what falls in it."""
    time = find_time(each, each.track.used)
    if time is None:
        frames = find_frames(each, each.track.used)
        count = np.asarray(each.table.numbers(frames, "the log")) if frames else np.arange(len(each.position))
        rates = {f"{rate:g} Hz": 1.0 / rate for rate in FRAME_RATES}
        return SeenTrack(each, None, frames, None, _curve(*clean_poses(count, each.position), rates))
    stamps, position = clean_poses(time.values, each.position)
    wide = float(np.linalg.norm(np.ptp(position, axis=0))) if len(position) else 0.0
    units = {
        u: f
        for u, f in LENGTHS.items()
        if u == each.track.unit or (f * _farthest(position) < FAR and f * wide < WIDEST_M)
    }
    if each.track.unit == "in":
        units = {"m": INCH_M}
    seconds = {u: SECONDS[u] for u in time.units}
    fall = find_free_fall(stamps, position, seconds, units)
    return SeenTrack(each, time, "", fall, None if fall else _curve(stamps, position, seconds))


def _curve(time: np.ndarray, position: np.ndarray, units: dict[str, float]) -> tuple[int, int] | None:
    """Axis and up of a fall in an unknown unit of length, at the unit of time that shows most of it."""
    found = [find_unscaled_fall(seconds * time, position) for seconds in units.values()]
    falls = [(fall.seconds / s, fall) for s, fall in zip(units.values(), found, strict=True) if fall]
    if not falls:
        return None
    _, longest = max(falls, key=lambda each: each[0])
    return longest.axis, longest.up


def _farthest(position: np.ndarray) -> float:
    return float(np.abs(position).max()) if position.size else 0.0


def choose_track(seen: Sequence[SeenTrack]) -> tuple[SeenTrack, str]:
    """The body among the tracks of one table, and what to ask where several move."""
    farthest = max(one.way for one in seen)
    moving = [one for one in seen if one.way > STILL * farthest] or list(seen)
    falling = [one for one in moving if one.fall is not None]
    fits = falling or moving

    def rank(one: SeenTrack) -> tuple[float, bool, float]:
        return 0.0 if one.fall is None else one.fall.seconds, bool(one.each.words & BODIES), one.way

    best = max(fits, key=rank)
    others = ", ".join(one.each.name for one in fits if one is not best)
    return best, f"is it {best.each.name}, and not {others}?" if others else ""


def plane_of_most(runs: Sequence[SeenTrack]) -> int | None:
    """The axis across the plane that most tracks stay in; None where they stay in none."""
    across = [plane_across(run) for run in runs]
    axis = max(range(3), key=across.count)
    return axis if across.count(axis) > 0.5 * len(runs) else None


def plane_across(run: SeenTrack) -> int | None:
    """The axis of a track's three along which it hardly moves; None where there is none."""
    widths = _widths(run.each)
    order = np.argsort(widths)
    return int(order[0]) if len(widths) == 3 and widths[order[0]] < FLAT * widths[order[1]] else None


def contact_seconds(run: SeenTrack, fall: FreeFall, up: np.ndarray) -> float:
    """How long [s] a run moves in contact."""
    if run.time is None:
        return 0.0
    time, position = clean_poses(run.time.seconds(fall.time_unit), LENGTHS[fall.unit] * run.each.position)
    if len(time) < LEAST_POSES:
        return 0.0
    lasted = 0.0
    for phase in find_phases(time, position @ up, G):
        part = position[phase.begin : phase.end]
        seconds = float(time[phase.end - 1] - time[phase.begin])
        moves = float(np.linalg.norm(np.ptp(part, axis=0))) > SLIDES_M
        lasted += seconds if phase.kind == CONTACT and seconds > SLIDES_S and moves else 0.0
    return lasted


def clean_poses(time: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses that were seen, at stamps that increase, the first ones of a long track."""
    keep = np.isfinite(time) & np.isfinite(position).all(axis=1)
    time, position = time[keep], position[keep]
    if len(time):
        ahead = np.concatenate([[True], np.diff(np.maximum.accumulate(time)) > 0])
        time, position = time[ahead], position[ahead]
    return time[:MOST_POSES], position[:MOST_POSES]
