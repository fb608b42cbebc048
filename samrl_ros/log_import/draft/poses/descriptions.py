"""Ways in which a log of poses can be read, and how well each closes the chain of poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_ros.log_import.draft.column_names import BASES, CAMERAS, CARRIED
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.poses.pose_turns import turns_apart
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack
from samrl_ros.log_import.draft.tracks.track_entries import rotation_readings
from samrl_ros.log_import.pose_importer import import_poses
from samrl_ros.log_import.pose_specs import PoseRecordingSpec
from samrl_ros.log_import.sources import SourceData

CLEARLY = 4.0  # times better than the next description: that is proof
TURN = 0.02  # [rad] by which turns of target and flange may differ in any case


@dataclass(frozen=True, eq=False)
class Description:
    """One way to read a log: who carries the camera, and how turns are written."""

    recording: PoseRecording
    poses: dict[str, Any]  # of the mapping
    says: str
    closes_m: float = float("inf")  # to which its chain closes

    @property
    def arm(self) -> str:
        """Whose flange the log has: the camera's arm or the tool's."""
        return "camera_arm" if "camera_arm" in self.poses else "tool_arm"


def list_descriptions(
    seen: LoggedTrack,
    carried: LoggedTrack,
    entries: dict[str, dict[str, Any]],
    at_rest: bool,
    cache: dict[str, SourceData],
    draft: Draft,
) -> list[Description]:
    """Every way in which the log can be read."""
    readings = rotation_readings(seen, entries["seen"]), rotation_readings(carried, entries["carried"])
    found: list[Description] = []
    for arm, first, second in product(("camera_arm", "tool_arm"), *readings):
        poses: dict[str, Any] = {"target_in_camera": dict(first[0]), arm: {"flange": dict(second[0])}}
        if is_inverse(seen):
            poses["target_in_camera"]["inverse"] = True
        if is_base_in_flange(carried):
            poses[arm]["flange"]["inverse"] = True
        if at_rest:
            poses["at_rest"] = True
        tried = [words for (_, words), of in zip((first, second), readings, strict=True) if len(of) > 1]
        says = "the arm carries the camera" if arm == "camera_arm" else "the camera stands still"
        says = ", ".join([says, *dict.fromkeys(tried)])
        if (recording := read_described(poses, cache, draft)) is not None:
            found.append(Description(recording, poses, says))
    return found


def close_descriptions(descriptions: Sequence[Description]) -> list[Description]:
    """Those whose turns belong together and whose chain can be closed, the one that closes best first."""
    apart = [turns_apart(one.recording) for one in descriptions]
    most = CLEARLY * min(apart, default=0.0) + TURN
    closed = [
        replace(one, closes_m=closes_m)
        for one, turns in zip(descriptions, apart, strict=True)
        if turns <= most and (closes_m := closing(one.recording)) is not None
    ]
    return sorted(closed, key=lambda one: one.closes_m)


def read_described(poses: dict[str, Any], cache: dict[str, SourceData], draft: Draft) -> PoseRecording | None:
    """The recording by one description; None where it cannot be read so."""
    content = {"name": "drafted", "sources": draft.sources, "poses": poses}
    try:
        spec = PoseRecordingSpec.read(content, "draft")
        return import_poses(spec, "", Path(), Path(), cache).recording
    except InputError:
        return None


def closing(recording: PoseRecording) -> float | None:
    """Error of its chain [m]; None where it cannot be solved."""
    try:
        return closing_error(recording)
    except InputError:
        return None


def is_inverse(seen: LoggedTrack) -> bool:
    """Whether names say that these are the camera's poses in what it sees, be it a map of its own."""
    if seen.is_camera_in_map and seen.frames is None:
        return True
    child, parent = seen.likely_frames or (frozenset(), frozenset())
    return bool(child & CAMERAS and parent) and not parent & CAMERAS and not seen.of_frames


def is_base_in_flange(carried: LoggedTrack) -> bool:
    """Whether names say that these are the base's poses in the flange."""
    child, parent = carried.likely_frames or (frozenset(), frozenset())
    return bool(child & BASES and parent & (CARRIED | CAMERAS)) and not carried.of_frames
