"""Drafts a mapping of a table whose rows hold a target's pose in a camera and an arm's joints.

Most scripts of hand-eye calibration write this: a row per view, the joints as the driver gives them and the
board as OpenCV gives it. The flange follows from the arm's description. Which columns are which joint, in
which unit, who carries the camera and how turns are written shows in the chain: it closes to millimetres with
the right description, to decimetres with a wrong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.diagnosis.residuals.poses.solve import solved
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.joints.position_columns import (
    JointColumns,
    find_joint_columns,
    has_torques,
    likely_joints,
)
from samrl_ros.log_import.draft.poses.descriptions import (
    CLEARLY,
    Description,
    close_descriptions,
    is_inverse,
    read_described,
)
from samrl_ros.log_import.draft.poses.pose_draft import (
    CLOSES_M,
    MOST_VIEWS,
    NOTHING_M,
    add_pose_source,
    side_of,
    state,
)
from samrl_ros.log_import.draft.tracks.logged_tracks import LoggedTable, LoggedTrack, files_of
from samrl_ros.log_import.draft.tracks.track_entries import (
    FULL_TURN,
    add_columns,
    add_track_entry,
    every_nth,
    rotation_readings,
    source_data,
)
from samrl_ros.recordings.read import moving_joints

SOURCE = "log"
ARMS = {"camera_arm": "the arm carries the camera", "tool_arm": "the camera stands still"}
ROWS_OF_JOINTS = 50  # from which on they are drafted as a machine's
AT_BASE_M, AT_BASE_RAD = 0.02, 0.05  # from an arm's base, that no camera is
LEAST_JOINTS = 3  # numbered columns beside a target that are taken for an arm's without its description


def draft_joint_table(tables: Sequence[LoggedTable], urdf: str, urdf_file: str) -> Draft | None:
    """A draft of files with one target's poses and an arm's joints in the same rows; None of any other log.

    With torques beside them joints say more by themselves, and two poses need no joints. A pose that the
    joints give in their own base is a tool's, and many rows that close no chain are of a machine.

    Args:
        tables: of the log; several of the same columns are runs of one chain, the last of which is held out.
        urdf: text of the arm's description.
        urdf_file: where it lies.

    Raises:
        InputError: no description of such a table can be compared.
    """
    joints = moving_joints(urdf)
    posed = [each for each in tables if any(track.track.whole for track in each.tracks())]
    found = [(seen, sets) for each in posed if (seen := _target(each)) is not None
             and (sets := find_joint_columns(each.table, joints, seen.track.used))]  # fmt: skip
    if not found or len(found) < len(posed) or len({tuple(seen.table.columns) for seen, _ in found}) > 1:
        return None
    seen, sets = found[0]
    draft = Draft(about="Drafted by samrl bag draft. Every entry has its reason beside it; check them.")
    time, at_rest = add_pose_source(SOURCE, seen, (seen,), draft)
    entry = add_track_entry(seen, SOURCE, draft)
    entry.pop("source")  # it is the only one
    listed = {
        columns: _list(seen, entry, columns, urdf_file, time, at_rest, draft) for columns in sets
    }  # by identity
    closed = close_descriptions([one for ways in listed.values() for one in ways])
    many = len(time) >= ROWS_OF_JOINTS
    if not closed and not many:
        raise InputError(
            f"{seen.name}: the target's poses and the joints {sets[0].names} cannot be compared by"
            f" {urdf_file}; write the mapping by hand"
        )
    if not closed or _is_of_the_arm(closed[0]) or (many and closed[0].closes_m > CLOSES_M):
        return None  # joints of a machine, beside its own pose or something that it does not move
    columns_of = {id(one.poses): columns for columns, ways in listed.items() for one in ways}
    _take(closed, [columns_of[id(one.poses)] for one in closed], seen, joints, draft)
    draft.unused += [f"{each.path.name}: no pose" for each in tables if each not in posed]
    _add_recordings([each.path for each, _ in found], draft)
    return draft


def draft_with_description_beside(paths: Sequence[Path], tables: Sequence[LoggedTable]) -> Draft | None:
    """The same by the only URDF that lies in the log's folders; None of any other log.

    Raises:
        InputError: joints lie beside a target's poses, and no description of them.
    """
    descriptions = [file for path in paths for file in files_of(path) if file.suffix.lower() == ".urdf"]
    if len(descriptions) == 1:
        model = descriptions[0].resolve()
        drafted = draft_joint_table(tables, read_model(model, {}).urdf, str(model))
        if drafted is not None:
            drafted.note("poses", f"the arm is described by {model.name}, which lies with the log")
            return drafted
    _refuse_without_description(tables)
    return None


def _refuse_without_description(tables: Sequence[LoggedTable]) -> None:
    """Say what is missing of a log that holds a target's poses beside joints.

    Raises:
        InputError: it is one, and no description of the arm is there.
    """
    for each in tables:
        if (seen := _target(each)) is None or side_of(seen) <= 0:
            continue
        columns = likely_joints(each.table, seen.track.used)
        if len(columns) >= LEAST_JOINTS:
            raise InputError(
                f"{seen.name} is a target's pose, and {', '.join(columns)} beside it look like joints:"
                " give the arm's description by --urdf, from which the flange's poses follow"
            )


def _target(each: LoggedTable) -> LoggedTrack | None:
    """The only pose of a table, unless its name says that an arm carries it."""
    placed = [track for track in each.tracks() if track.track.whole]
    if each.part or len(placed) != 1 or side_of(placed[0]) < 0 or has_torques(each.table):
        return None
    return placed[0]


def _is_of_the_arm(best: Description) -> bool:
    """Whether a still camera would be the arm's base, up to a turn about z: forward kinematics, no view."""
    if best.arm != "tool_arm" or best.closes_m > CLOSES_M:
        return False
    camera = solved([best.recording])[0].camera
    return bool(np.linalg.norm(camera[:3, 3]) < AT_BASE_M and camera[2, 2] > np.cos(AT_BASE_RAD))


def _list(
    seen: LoggedTrack, entry: dict[str, Any], columns: JointColumns, urdf_file: str, time: np.ndarray,
    at_rest: bool, draft: Draft,
) -> list[Description]:  # fmt: skip
    """Every way to read the table with these columns as joints."""
    source = draft.sources[SOURCE]
    before = dict(source["columns"])
    formulas = add_columns(columns.parts, source)
    if not np.isfinite(columns.values).all():
        source["missing"] = "drop_row"
    cache = {SOURCE: source_data([seen], source, time)}
    if at_rest:
        cache[SOURCE] = every_nth(cache[SOURCE], MOST_VIEWS)
    turned = float(np.nanmax(np.abs(columns.values)))
    units = [columns.unit] if columns.unit else ["deg"] if turned > 2.0 * FULL_TURN else ["rad", "deg"]
    rotations = rotation_readings(seen, entry)
    out = []
    for arm, unit, (target, words) in product(ARMS, units, rotations):
        of_joints = {"names": list(columns.joints), "position": formulas, "angle_unit": unit}
        poses: dict[str, Any] = {
            "target_in_camera": dict(target), arm: {"joints": of_joints, "urdf": urdf_file}
        }  # fmt: skip
        if is_inverse(seen):
            poses["target_in_camera"]["inverse"] = True
        if at_rest:
            poses["at_rest"] = True
        open_ = [f"joints in {unit}"] if len(units) > 1 else []
        open_ += [words] if len(rotations) > 1 else []
        if (recording := read_described(poses, cache, draft)) is not None:
            out.append(Description(recording, poses, ", ".join([ARMS[arm], *open_])))
    source["columns"] = before
    return out


def _take(
    closed: Sequence[Description], columns: Sequence[JointColumns], seen: LoggedTrack, joints: Sequence[str],
    draft: Draft,
) -> None:  # fmt: skip
    """The description that closes the chain best, its joints, and what it leaves open."""
    best, used, arm = closed[0], columns[0], closed[0].arm
    add_columns(used.parts, draft.sources[SOURCE])
    draft.poses, draft.closes_m = best.poses, best.closes_m
    reason, question = f"{best.says}: the chain then closes to {1e3 * best.closes_m:.1f} mm", ""
    if best.closes_m > CLOSES_M:
        question = "no description closes the chain; are these one target and this arm's joints?"
    elif len(closed) > 1:
        other = closed[1].says + ("" if columns[1] is used else f", with the joints {columns[1].names}")
        reason += f", to {1e3 * closed[1].closes_m:.0f} mm if {other}"
        if closed[1].closes_m < CLEARLY * best.closes_m + NOTHING_M:
            question = f"is it so, and not that {other}?"
    draft.note(f"poses.{arm}", reason, question)
    how = "by their names" if used.by_name else f"in their order: {', '.join(used.joints)}"
    sure = used.by_name or best.closes_m <= CLOSES_M
    draft.note(
        f"poses.{arm}", f"{used.names} are the joints {how}; the flange is the URDF's last"
        " link behind these", "" if sure else "are they these joints?",
    )  # fmt: skip
    if missing := [joint for joint in joints if joint not in used.joints]:
        draft.note(
            f"poses.{arm}", f"{', '.join(missing)} of the URDF are not in the log", "do they stand still?"
        )
    still = "stands still" if arm == "camera_arm" else "rides on the arm"
    sure = side_of(seen) > 0 and seen.track.rotation == "rotation_vector" and not seen.track.vague
    draft.note(
        "poses.target_in_camera", f"{seen.name}: {_said_of(seen, sure)}",
        "" if sure else "is it the target in the camera? If the log gives the camera in the target (set"
        f" `inverse: true`), the camera {still}",
    )  # fmt: skip
    state(arm, None, draft)


def _said_of(seen: LoggedTrack, sure: bool) -> str:
    if sure:
        return "rvec and tvec, the board in the camera, as OpenCV's solvePnP gives it"
    return "by its name" if side_of(seen) > 0 else "the only pose beside the joints"


def _add_recordings(paths: Sequence[Path], draft: Draft) -> None:
    """One for each file; the last of several is held out."""
    if len(paths) > 1:
        draft.sources[SOURCE]["file"] = "{name}" + paths[0].suffix
        draft.note("recordings", "files with the same columns: one chain; the last by name is held out")
    last = len(paths) - 1
    for number, path in enumerate(sorted(paths)):
        role = "held_out" if 0 < number == last else "fit"
        draft.recordings.append({"name": path.stem, "role": role})
