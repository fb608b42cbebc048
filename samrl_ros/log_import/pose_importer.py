"""Runs a mapping of poses: files to columns, columns to tracks, tracks to recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTolerances, PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.diagnosis.residuals.poses.seen_size import size_note
from samrl_ros.log_import.formulas import evaluate
from samrl_ros.log_import.imported_files import check_names, entries_of
from samrl_ros.log_import.pose_specs import (
    ANGLES,
    LENGTHS,
    ROTATIONS,
    ArmSpec,
    FormulaList,
    JointsSpec,
    PoseRecordingSpec,
    TrackSpec,
    rotations_of,
    rotations_of_matrices,
)
from samrl_ros.log_import.resampling import are_between
from samrl_ros.log_import.sources import SourceData, read_source, update_digest

SLOW_HZ = 5.0  # below it a track is no motion that can be interpolated


@dataclass(frozen=True, eq=False)
class ImportedPoses:
    """A recording of poses made from logs, and what became of them."""

    recording: PoseRecording
    role: str  # fit or held_out
    report: tuple[str, ...]
    notes: tuple[str, ...]


def poses_of(text: str, path: Path, data: Path) -> list[ImportedPoses]:
    """Every recording of a mapping's text; `path` names it in messages.

    Raises:
        InputError: with the key path of what is wrong.
    """
    general, entries = entries_of(text, path)
    made = []
    for number, entry in enumerate(entries):
        where = f"{path.name}: recordings[{number}]"
        spec = PoseRecordingSpec.read({**general, **entry} if isinstance(entry, dict) else entry, where)
        made.append(import_poses(spec, text, data, path.parent))
    check_names(made, path)
    if made and (note := size_note(made[0].recording)):
        made[0] = replace(made[0], notes=(*made[0].notes, note))
    return made


def import_poses(
    spec: PoseRecordingSpec,
    text: str,
    data: Path,
    beside: Path,
    known: Mapping[str, SourceData] | None = None,
) -> ImportedPoses:
    """Make one recording.

    Args:
        spec: of the recording.
        text: the mapping's.
        data: folder that paths count from.
        beside: the mapping's folder.
        known: sources that were read already.

    Raises:
        InputError: with the key path of what is wrong.
    """
    notes: list[str] = []
    constants = {name: np.asarray(value, dtype=float) for name, value in spec.constants.items()}
    cache = dict(known or {})
    for source in map(spec.source_of, spec.readers().values()):
        if source not in cache:
            cache[source] = read_source(spec, source, constants, data, notes, spec.poses.at_rest)
    seen = read_track(spec, "target_in_camera", spec.poses.target_in_camera, cache)
    zero = float(seen.time[0])
    arms: dict[str, ArmPoses | None] = {}
    for role in ("camera_arm", "tool_arm"):
        described: ArmSpec | None = getattr(spec.poses, role)
        arms[role] = None if described is None else _arm(spec, role, described, cache, zero, data, beside)
    seen = PoseTrack(seen.time - zero, seen.position, seen.quat_xyzw)
    seen, timed = _within(spec, seen, [a for a in arms.values() if a is not None], notes)
    digest = hashlib.sha256(text.encode() + spec.name.encode())
    for source in cache.values():
        for file in source.files:
            update_digest(digest, file)
    recording = PoseRecording(
        spec.name,
        ", ".join(dict.fromkeys(str(f) for s in cache.values() for f in s.files)),
        digest.hexdigest(),
        seen,
        arms["camera_arm"],
        arms["tool_arm"],
        _stated(spec, "camera_in_flange", "camera_in_base"),
        _stated(spec, "base_in_base", "target_in_base"),
        _stated(spec, "target_in_flange"),
        spec.poses.camera,
        spec.poses.target,
        timed=timed,
        tolerances=_tolerances(spec),
    )
    return ImportedPoses(recording, spec.role, tuple(_describe(recording)), tuple(notes))


def _stated(spec: PoseRecordingSpec, *keys: str) -> Pose | None:
    """The constant transform that stands under one of several keys, by who carries the camera."""
    for key in keys:
        if (given := getattr(spec.poses, key)) is not None:
            return given.pose(f"{spec.path}.poses.{key}")
    return None


def _tolerances(spec: PoseRecordingSpec) -> PoseTolerances:
    if spec.tolerances is None:
        return PoseTolerances()
    try:
        return PoseTolerances.from_mapping(spec.tolerances)
    except InputError as error:
        raise InputError(f"{spec.path}.tolerances: {error}") from error


def read_track(
    spec: PoseRecordingSpec, key: str, track: TrackSpec, cache: Mapping[str, SourceData]
) -> PoseTrack:
    """A pose over time, in m, at its source's own time.

    Args:
        spec: of the recording.
        key: of the pose, for messages.
        track: what its columns mean.
        cache: sources that were read.

    Raises:
        InputError: numbers that are no pose.
    """
    source, where = cache[spec.source_of(track)], f"{spec.path}.poses.{key}"
    count, given = len(source.time), track.quantities
    values = {
        name: block_of(formulas, source.values, count, f"{where}.{name}") for name, formulas in given.items()
    }
    if "matrix" in values:
        rotations, position = matrices_of(values["matrix"], where)
    else:
        (kind,) = (name for name in ROTATIONS if name in values)
        rotations = rotations_of(kind, values[kind], track.order, track.angle_unit, where)
        position = values["position"]
        if position.shape[1] != 3:
            raise InputError(f"{where}.position has {position.shape[1]} numbers per sample, must be 3")
    position = LENGTHS[track.unit] * position
    if track.inverse:
        rotations = rotations.inv()
        position = -rotations.apply(position)
    keep = inside_range(spec.time_range, source.time)
    return PoseTrack(source.time[keep], position[keep], rotations.as_quat()[keep])


def matrices_of(numbers: np.ndarray, where: str) -> tuple[Rotation, np.ndarray]:
    """Rotations and positions (N, 3) of matrices (N, 12 or 16), row by row. Raises `InputError`."""
    if numbers.shape[1] not in (12, 16):
        raise InputError(f"{where}.matrix has {numbers.shape[1]} numbers, must be 12 or 16")
    rows = numbers[:, :12].reshape(len(numbers), 3, 4)
    return rotations_of_matrices(rows[:, :, :3], f"{where}.matrix"), rows[:, :, 3]


def inside_range(given: tuple[int | float | None, int | float | None] | None, time: np.ndarray) -> np.ndarray:
    """Mask (N,) of times within a range since the first [s]; None is open."""
    low, high = given or (None, None)
    since = time - time[0]
    return (since >= (-np.inf if low is None else low)) & (since < (np.inf if high is None else high))


def block_of(given: FormulaList, values: dict[str, Any], count: int, where: str) -> np.ndarray:
    """Values (N, K) of formulas."""
    parts = [np.asarray(evaluate(formula, values, where), dtype=float) for formula in given.formulas]
    if given.listed:
        parts = [np.broadcast_to(part, (count,))[:, None] for part in parts]
    block = np.concatenate([part if part.ndim == 2 else part[:, None] for part in parts], axis=1)
    if len(block) != count:
        raise InputError(f"{where} gives shape {block.shape}, must have {count} samples")
    if not np.isfinite(block).all():
        row = int(np.argwhere(~np.isfinite(block))[0, 0])
        raise InputError(f"{where}: sample {row} is not finite; set `missing: drop_row` of the source")
    return block


def _arm(
    spec: PoseRecordingSpec, role: str, arm: ArmSpec, cache: dict[str, SourceData], zero: float, data: Path,
    beside: Path,
) -> ArmPoses:  # fmt: skip
    flange = None
    if arm.flange is not None:
        track = read_track(spec, f"{role}.flange", arm.flange, cache)
        flange = PoseTrack(track.time - zero, track.position, track.quat_xyzw)
    joints: JointsSpec | None = arm.joints
    if joints is None or arm.urdf is None:
        return ArmPoses(role, flange)
    where = f"{spec.path}.poses.{role}"
    source = cache[spec.source_of(joints)]
    angles = ANGLES[joints.angle_unit] * block_of(
        FormulaList(joints.position), source.values, len(source.time), f"{where}.joints.position"
    )
    if angles.shape[1] != len(joints.names):
        raise InputError(
            f"{where}.joints.position has {angles.shape[1]} columns for {len(joints.names)} names"
        )
    found = next((f for f in (data / arm.urdf, beside / arm.urdf) if is_file(f)), None)
    if found is None:
        raise InputError(f"{where}.urdf: no file {data / arm.urdf} or {beside / arm.urdf}")
    keep = inside_range(spec.time_range, source.time)
    return ArmPoses(
        role, flange, tuple(joints.names), source.time[keep] - zero, angles[keep], read_model(found, {}).urdf
    )


def _within(
    spec: PoseRecordingSpec, seen: PoseTrack, arms: list[ArmPoses], notes: list[str]
) -> tuple[PoseTrack, bool]:
    """Seen poses at times at which every arm is known, and whether stamps tell of motion."""
    timed = not spec.poses.at_rest
    if timed and all(len(a.stamps) == len(seen) and np.array_equal(a.stamps, seen.time) for a in arms):
        timed = len(seen) > 1 and float(np.median(np.diff(seen.time))) < 1.0 / SLOW_HZ
    for arm in arms if timed else ():
        step = float(np.median(np.diff(arm.stamps)))
        if step > 1.0 / SLOW_HZ:
            raise InputError(
                f"{spec.path}.poses.{arm.role} is given at {1 / step:.2g} Hz, below {SLOW_HZ:g} Hz: between"
                " its stamps nobody knows it; say `at_rest: true` if poses were taken at rest"
            )
    if spec.poses.at_rest:
        return _paired(spec, seen, arms, notes), False
    begin = max(float(a.stamps[0]) for a in arms)
    end = min(float(a.stamps[-1]) for a in arms)
    inside = seen.between(begin, np.nextafter(end, np.inf))
    if len(inside) < 2:
        raise InputError(
            f"{spec.path}: the target is seen from 0 to {seen.time[-1]:.3f} s, the arms are known from"
            f" {begin:.3f} to {end:.3f} s after its first pose: no overlap; shift one by `time.offset_s`"
        )
    if len(inside) < len(seen):
        notes.append(f"{len(seen) - len(inside)} seen poses lie outside of the arms' stamps and are left out")
    return (_outside_gaps(spec, inside, arms, notes) if timed else inside), timed


def _outside_gaps(
    spec: PoseRecordingSpec, seen: PoseTrack, arms: list[ArmPoses], notes: list[str]
) -> PoseTrack:
    """Seen poses that fall into no gap of an arm's stamps: a spline over one is no measurement."""
    known = np.logical_and.reduce([are_between(seen.time, arm.stamps, splined=True) for arm in arms])
    if known.all():
        return seen
    if known.sum() < 2:
        raise InputError(
            f"{spec.path}: {known.sum()} of {len(seen)} seen poses fall into no gap of an arm; record"
            " the arms all the time, or say `at_rest: true` if poses were taken at rest"
        )
    notes.append(f"{np.count_nonzero(~known)} seen poses fall into gaps of the arms' stamps and are left out")
    return PoseTrack(seen.time[known], seen.position[known], seen.quat_xyzw[known])


def _paired(spec: PoseRecordingSpec, seen: PoseTrack, arms: list[ArmPoses], notes: list[str]) -> PoseTrack:
    """Poses seen at rest for which every arm has a pose nearer in time than the next view."""
    step = float(np.median(np.diff(seen.time))) if len(seen) > 1 else np.inf
    apart = np.zeros(len(seen))
    for arm in arms:
        near = np.min(np.abs(seen.time[:, None] - arm.stamps), axis=1)
        apart = np.maximum(apart, near)
    keep = apart < 0.5 * step
    if keep.sum() < 2:
        raise InputError(
            f"{spec.path}: {keep.sum()} of {len(seen)} seen poses have an arm's pose within"
            f" {0.5 * step:.3g} s (half the time between views); shift one by `time.offset_s`,"
            " or leave `time` out where rows are pairs"
        )
    if not keep.all():
        notes.append(f"{np.count_nonzero(~keep)} seen poses have no pose of the arm and are left out")
    return PoseTrack(seen.time[keep], seen.position[keep], seen.quat_xyzw[keep])


def _describe(recording: PoseRecording) -> list[str]:
    def describe_track(name: str, time: np.ndarray) -> str:
        rate = 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else 0.0
        return f"{name}: {len(time)} poses at {rate:.4g} Hz, {time[0]:.3f} to {time[-1]:.3f} s"

    distance = np.linalg.norm(recording.seen.position, axis=1)
    lines = [describe_track(f"{recording.target} in {recording.camera}", recording.seen.time)]
    lines += [describe_track(f"{arm.role}", arm.stamps) for arm in recording.arms]
    lines.append(f"distance {distance.min():.3f} .. {distance.max():.3f} m")
    lines.append("poses in motion" if recording.timed else "poses at rest: nothing is said of clocks")
    return lines
