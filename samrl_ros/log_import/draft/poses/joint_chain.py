"""Drafts a mapping of a target that a camera sees while joints of a described arm move: no flange is logged.

With efforts or commands beside them joints say more by themselves; what is drafted here tells the camera's
place, the joints' zeros and links from the target's poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.column_names import CAMERAS
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.poses.descriptions import CLEARLY, closing, read_described
from samrl_ros.log_import.draft.poses.pose_draft import CLOSES_M, MOST_VIEWS, side_of, state
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTrack, read_logged_tables
from samrl_ros.log_import.draft.tracks.track_entries import (
    add_track_entry,
    add_track_source,
    every_nth,
    source_data,
)
from samrl_ros.log_import.formats.rosbag import is_bag, list_topics
from samrl_ros.log_import.sources import SourceData
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table
from samrl_ros.recordings.read import moving_joints

JOINT_STATES = "sensor_msgs/msg/JointState"
ARMS = {"camera_arm": "the arm carries the camera", "tool_arm": "the camera stands still"}


def draft_joint_chain(paths: Sequence[Path], urdf: str, urdf_file: str) -> Draft | None:
    """A draft of bags with one target's poses and joints without efforts; None of any other log.

    Args:
        paths: bags of one arm and camera; the last of several is held out.
        urdf: text of the arm's description.
        urdf_file: where it lies.

    Raises:
        InputError: a bag that cannot be read.
    """
    if not paths or not all(is_bag(path) for path in paths):
        return None
    tracks = [track for table in read_logged_tables(paths[:1]) for track in table.tracks()]
    seen = [each for each in tracks if each.track.whole and _is_seen(each)]
    states = [topic for topic in list_topics(paths[0], "the log") if topic.type == JOINT_STATES]
    if len(seen) != 1 or len(states) != 1:
        return None
    table = read_table(paths[0], CsvOptions(), "the log", states[0].name)
    joints = [joint for joint in moving_joints(urdf) if f"position.{joint}" in table.columns]
    if not joints or table.time is None or any(f"effort.{joint}" in table.columns for joint in joints):
        return None
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    add_track_source("target", seen[0], draft)
    target = add_track_entry(seen[0], "target", draft)
    draft.note("poses.target_in_camera", f"{seen[0].name}: by its name, or the camera's frame of its header")
    columns = {f"q{k + 1}": f"position.{joint}" for k, joint in enumerate(joints)}
    draft.sources["arm"] = {"file": paths[0].name, "part": states[0].name, "columns": columns}
    missing = [joint for joint in moving_joints(urdf) if joint not in joints]
    if missing:
        draft.note("poses", f"{', '.join(missing)} of the URDF are not in the log", "do they stand still?")
    of_arm = {"joints": {"source": "arm", "names": joints, "position": list(columns)}, "urdf": urdf_file}
    _describe_arm(target, of_arm, _cache(seen[0], table, columns, draft), draft)
    for number, path in enumerate(paths):
        held = 0 < number == len(paths) - 1
        entry = {"name": path.stem, "role": "held_out" if held else "fit"}
        several = {"files": dict.fromkeys(("target", "arm"), path.name)} if len(paths) > 1 else {}
        draft.recordings.append({**entry, **several})
    return draft


def _is_seen(each: LoggedTrack) -> bool:
    """Whether a name says that it is a target's, or the header that it is given in a camera."""
    parent = each.frames[1] if each.frames else frozenset()
    return side_of(each) > 0 or bool(parent & CAMERAS)


def _cache(each: LoggedTrack, table: Table, columns: dict[str, str], draft: Draft) -> dict[str, SourceData]:
    assert each.table.time is not None and table.time is not None
    target = source_data([each], draft.sources["target"], each.table.time)
    values = {short: np.asarray(table.numbers(name, "the log")) for short, name in columns.items()}
    keep = np.isfinite(np.stack(list(values.values()))).all(axis=0)
    keep &= np.concatenate([[True], np.diff(table.time) > 0])
    if not np.isfinite(np.stack(list(values.values()))).all():
        draft.sources["arm"]["missing"] = "drop_row"
    arm = SourceData((), table.time[keep], {short: column[keep] for short, column in values.items()})
    return {"target": every_nth(target, MOST_VIEWS), "arm": arm}


def _describe_arm(target: dict, of_arm: dict, cache: dict[str, SourceData], draft: Draft) -> None:
    """Who carries the camera, by which description closes the chain."""
    found = []
    for arm in ARMS:
        poses = {"target_in_camera": target, arm: of_arm}
        recording = read_described(poses, cache, draft)
        if recording is not None and (left := closing(recording)) is not None:
            found.append((left, arm, poses))
    if not found:
        raise InputError("the target's poses and the joints cannot be compared; write the mapping by hand")
    found.sort(key=lambda one: one[0])
    left, arm, draft.poses = found[0]
    reason, question = f"{ARMS[arm]}: the chain then closes to {1e3 * left:.1f} mm", ""
    if left > CLOSES_M:
        question = "no description closes the chain; do these joints move the camera or the target?"
    elif len(found) > 1:
        other = f"{1e3 * found[1][0]:.0f} mm if {ARMS[found[1][1]]}"
        reason += f", to {other}"
        question = "" if found[1][0] > CLEARLY * left else f"is it so, and not that {ARMS[found[1][1]]}?"
    draft.note(f"poses.{arm}", f"{reason}; the flange is the URDF's last link behind these joints", question)
    state(arm, None, draft)
