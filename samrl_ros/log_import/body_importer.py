"""Runs a mapping of bodies: files to columns, columns to tracks of a free body, tracks to recordings."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyRecording, BodyTolerances, BodyTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.bodies.body_tracks import SEVERAL
from samrl_core.diagnosis.residuals.bodies.find_segments import find_segments
from samrl_ros.log_import.body_specs import TURNS, BodyRecordingSpec, BodyTrackSpec
from samrl_ros.log_import.formats.rosbag import is_bag
from samrl_ros.log_import.imported_files import check_names, entries_of
from samrl_ros.log_import.pose_importer import block_of, inside_range, matrices_of
from samrl_ros.log_import.pose_specs import ANGLES, LENGTHS, rotations_of
from samrl_ros.log_import.sources import SourceData, read_source, update_digest

FASTEST = 100.0  # [m/s] of what is called a body here
MOST_FILES = 5000  # that one pattern may name


@dataclass(frozen=True, eq=False)
class ImportedBody:
    """A recording of a body made from a log, and what became of it."""

    recording: BodyRecording
    role: str  # fit or held_out
    report: tuple[str, ...]
    notes: tuple[str, ...]


def bodies_of(text: str, path: Path, data: Path) -> list[ImportedBody]:
    """Every recording of a mapping's text; `path` names it in messages.

    Raises:
        InputError: with the key path of what is wrong.
    """
    general, entries = entries_of(text, path)
    made: list[ImportedBody] = []
    stated: list[str | None] = []
    for number, entry in enumerate(entries):
        where = f"{path.name}: recordings[{number}]"
        for one in _each_file(entry, general, data, where):
            own = {**general, **one} if isinstance(one, dict) else one
            spec = BodyRecordingSpec.read(own, where)
            stated.append(spec.role)
            made.append(import_body(spec, text, data))
    check_names(made, path)
    return _with_roles(made, [r for r in stated if r is not None])


def _with_roles(made: list[ImportedBody], stated: list[str]) -> list[ImportedBody]:
    """Every third of several recordings held out where the mapping gives no role at all."""
    if stated or len(made) < SEVERAL:
        return made
    return [replace(m, role="held_out") if k % SEVERAL == 1 else m for k, m in enumerate(made)]


def _each_file(entry: Any, general: dict[str, Any], data: Path, where: str) -> list[Any]:
    """An entry as it is, or one for each file that its `glob` names."""
    if not isinstance(entry, dict) or "glob" not in entry:
        if isinstance(entry, dict) and "hold_out_every" in entry:
            raise InputError(f"{where}.hold_out_every goes with `glob`; a single recording has a `role`")
        return [entry]
    rest = {k: v for k, v in entry.items() if k not in ("glob", "hold_out_every")}
    if "files" in rest or "files" in general:
        raise InputError(f"{where}.glob names the files, so `files` must be left out")
    pattern, every = entry["glob"], entry.get("hold_out_every", 0)
    if not isinstance(pattern, str) or pattern.startswith("/") or ".." in Path(pattern).parts:
        raise InputError(f"{where}.glob is {pattern!r}, must be a pattern below the folder of the data")
    if isinstance(every, bool) or not isinstance(every, int) or every < 0 or every == 1:
        raise InputError(f"{where}.hold_out_every is {every!r}, must be 2 or more, or 0 for none")
    sources = rest.get("sources", general.get("sources"))
    if not isinstance(sources, dict) or len(sources) != 1:
        raise InputError(f"{where}.glob needs exactly one source; name the files of several by recordings")
    found = sorted(p for p in data.glob(pattern) if p.is_file() or is_bag(p))
    if not found:
        raise InputError(f"{where}.glob: no file in {data} is like {pattern!r}")
    if len(found) > MOST_FILES:
        raise InputError(f"{where}.glob names {len(found)} files, at most {MOST_FILES} are read")
    out = []
    for k, file in enumerate(found):
        own = {**rest, "name": file.stem, "files": {next(iter(sources)): str(file.relative_to(data))}}
        if every:
            own["role"] = "held_out" if k % every == every - 1 else "fit"
        out.append(own)
    return out


def import_body(spec: BodyRecordingSpec, text: str, data: Path) -> ImportedBody:
    """Make one recording; `text` is the mapping's.

    Raises:
        InputError: with the key path of what is wrong.
    """
    notes: list[str] = []
    constants = {name: np.asarray(value, dtype=float) for name, value in spec.constants.items()}
    source = read_source(spec, spec.source_of(spec.bodies.track), constants, data, notes)
    track = _track(spec, spec.bodies.track, source)
    tolerances = BodyTolerances()
    if spec.tolerances is not None:
        try:
            tolerances = BodyTolerances.from_mapping(spec.tolerances)
        except InputError as error:
            raise InputError(f"{spec.path}.tolerances: {error}") from error
    digest, given = hashlib.sha256(text.encode() + spec.name.encode()), spec.bodies
    for file in source.files:
        update_digest(digest, file)
    where = f"{spec.path}.bodies"
    support = None if given.support is None else given.support.support(f"{where}.support")
    try:
        recording = BodyRecording(
            spec.name, ", ".join(map(str, source.files)), digest.hexdigest(), track,
            given.body.model(f"{where}.body"), support, given.pull, given.camera, given.phase, tolerances,
        )  # fmt: skip
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    report, more = _describe(recording)
    return ImportedBody(recording, spec.role or "fit", tuple(report), (*notes, *more))


def _track(spec: BodyRecordingSpec, track: BodyTrackSpec, source: SourceData) -> BodyTrack:
    where, count = f"{spec.path}.bodies.track", len(source.time)
    values = {
        name: block_of(formulas, source.values, count, f"{where}.{name}")
        for name, formulas in track.quantities.items()
    }
    kept = np.flatnonzero(inside_range(spec.time_range, source.time))
    if len(kept) < 2:
        raise InputError(f"{spec.path}.time_range {spec.time_range} leaves {len(kept)} of {count} poses")
    axes, turns = track.axes, ""
    rotations: Rotation | None = None
    if "matrix" in values:
        rotations, position = matrices_of(values["matrix"], where)
        turns = "xyz"
    else:
        position = values["position"]
        if position.shape[1] != len(axes):
            raise InputError(
                f"{where}.position has {position.shape[1]} numbers per sample for the axes {axes!r};"
                " state one formula per axis, or other `axes`"
            )
        for kind in (name for name in TURNS if name in values):
            turns = "xyz"
            if kind == "angle":
                (turns,) = set("xyz") - set(axes)
                turned = np.zeros((count, 3))
                turned[:, "xyz".index(turns)] = ANGLES[track.angle_unit] * values[kind][:, 0]
                rotations = Rotation.from_rotvec(turned)
            else:
                rotations = rotations_of(kind, values[kind], track.order, track.angle_unit, where)
    whole = np.zeros((count, 3))
    whole[:, ["xyz".index(axis) for axis in axes]] = LENGTHS[track.unit] * position
    quats = np.zeros((count, 4)) if rotations is None else rotations.as_quat()
    time = source.time[kept] - source.time[kept[0]]
    steps = np.diff(time)
    moved = np.linalg.norm(np.diff(whole[kept], axis=0), axis=1)[steps > 0] / steps[steps > 0]
    if len(moved) and float(np.median(moved)) > FASTEST:
        raise InputError(
            f"{where}: the body moves at {np.median(moved):.0f} m/s (median), at most {FASTEST:.0f} are read;"
            f" look for the `unit` of positions ({track.unit}) and of the source's time"
        )
    try:
        return BodyTrack(time, whole[kept], axes, quats[kept] if turns else np.zeros((0, 4)), turns)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _describe(recording: BodyRecording) -> tuple[list[str], list[str]]:
    """What the track becomes, and notes of what is left out."""
    track, found = recording.track, find_segments(recording)
    rate = 1.0 / float(np.median(np.diff(track.time)))
    turns = f", turns about {track.turns}" if track.turns else ", no turns"
    lines = [f"{len(track)} poses at {rate:.4g} Hz, {recording.duration:.3f} s; {track.axes}{turns}"]
    for segment in found.segments:
        speed = np.linalg.norm(segment.velocity, axis=1)
        lines.append(
            f"{segment.kind} {segment.time[0]:.3f} .. {segment.time[-1]:.3f} s, {len(segment)} poses,"
            f" {speed.min():.2f} .. {speed.max():.2f} m/s"
        )
    if found.impacts:
        shares = ", ".join(f"{-i.after / i.before:.3f}" for i in found.impacts)
        lines.append(f"{len(found.impacts)} rebounds, speed kept: {shares}")
    return lines, list(found.notes)
