"""A flange's time in a draft, where its clock and the camera's count from different moments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.poses.clock_alignment import align_clocks
from samrl_ros.log_import.draft.readings.clock_draft import TRANSPORT_S
from samrl_ros.log_import.pose_importer import read_track
from samrl_ros.log_import.pose_specs import PoseRecordingSpec
from samrl_ros.log_import.sources import SourceData

FOUND_S = 1.5  # up to which the diagnosis finds an offset itself


def align_flange(
    cache: Mapping[str, SourceData], entries: dict[str, dict[str, Any]], several: bool, draft: Draft
) -> SourceData:
    """The flange's source, shifted to the time of the target's where only so both turn alike.

    Args:
        cache: `target` and `flange`, as logged.
        entries: of the mapping, `seen` and `carried`.
        several: whether more runs follow, whose clocks may be apart otherwise.
        draft: gets the offset and the reason.
    """
    flange, source = cache["flange"], draft.sources["flange"]
    poses = {"target_in_camera": entries["seen"], "camera_arm": {"flange": entries["carried"]}}
    try:
        spec = PoseRecordingSpec.read({"name": "drafted", "sources": draft.sources, "poses": poses}, "draft")
        seen = read_track(spec, "target_in_camera", spec.poses.target_in_camera, cache)
        arm = spec.poses.camera_arm
        carried = None if arm is None or arm.flange is None else read_track(spec, "flange", arm.flange, cache)
    except InputError:
        return flange
    if carried is None or "time" not in source:
        return flange
    found = align_clocks(seen.time, seen.quat_xyzw, carried.time, carried.quat_xyzw)
    if found is None or not found.is_clear or abs(found.offset_s) < FOUND_S:
        return flange
    offset = round(found.offset_s, 4)
    source["time"] = {**source["time"], "offset_s": offset}
    apart = min(seen.time[-1], carried.time[-1]) < max(seen.time[0], carried.time[0])
    alike = f"at {offset:.12g} s both turn alike ({found.correlation:.2f}, else {found.without:.2f})"
    if apart:
        why, asked = (
            "the two share no time: their clocks count from different moments, so their offset says nothing",
            "",
        )
    else:
        why, asked = (
            "the two share their time, but do not turn at the same speed",
            "is one clock off by so much?",
        )
    if several:
        asked = " ".join([asked, "Is it so in every run? Else diagnose one at a time"]).strip()
    draft.note(
        "sources.flange.time",
        f"{why}; {alike}, and `offset_s` takes it out: what is left below {TRANSPORT_S:g} s is nobody's",
        asked,
    )
    draft.tolerances["stamp"] = TRANSPORT_S
    return replace(flange, time=flange.time + offset)
