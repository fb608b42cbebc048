"""Recordings of poses in files: arrays with one JSON text, written whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTolerances, PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.poses.poses import LEAST_AT_REST, split_poses
from samrl_ros.recordings.arrays_by_role import (
    check_unseen,
    read_by_role,
    read_described,
    write_described,
)

SUFFIX = ".poses.npz"
VERSION = 1
_SAME = 0.05  # share of poses that may be alike by chance
_TRACK = ("time", "position", "quat_xyzw")
_ROLES = ("camera_arm", "tool_arm")
_TRANSFORMS = ("camera_in_flange", "base_in_base", "target_in_flange")


def is_pose_file(path: Path) -> bool:
    """Whether a path is named like a recording of poses."""
    return path.name.endswith(SUFFIX)


def write_pose_file(recording: PoseRecording, path: Path) -> None:
    """Write a recording; an existing file is replaced."""
    about: dict[str, Any] = {
        "version": VERSION, "name": recording.name, "source": recording.source, "sha256": recording.sha256,
        "camera": recording.camera, "target": recording.target, "timed": recording.timed,
        "tolerances": asdict(recording.tolerances), "arms": {},
    }  # fmt: skip
    arrays = {f"seen_{key}": getattr(recording.seen, key) for key in _TRACK}
    for key in _TRANSFORMS:
        pose: Pose | None = getattr(recording, key)
        about[key] = None if pose is None else [*pose.position.tolist(), *pose.quat_xyzw.tolist()]
    for role in _ROLES:
        arm: ArmPoses | None = getattr(recording, role)
        if arm is None:
            continue
        about["arms"][role] = {"joints": list(arm.joints), "urdf": arm.urdf, "flange": arm.flange is not None}
        if arm.flange is not None:
            arrays |= {f"{role}_{key}": getattr(arm.flange, key) for key in _TRACK}
        arrays[f"{role}_joint_time"], arrays[f"{role}_joint_position"] = arm.joint_time, arm.joint_position
    write_described(path, about, arrays)


def read_pose_file(path: Path) -> PoseRecording:
    """Read a recording.

    Raises:
        InputError: the file is damaged, of another version or none of poses.
    """
    try:
        arrays, about = read_described(path, VERSION)
        roles = sorted(about["arms"])
        if not roles or not set(roles) <= set(_ROLES):
            raise ValueError(f"its arms are {', '.join(roles) or 'none'}, must be of {', '.join(_ROLES)}")

        def track(prefix: str) -> PoseTrack:
            return PoseTrack(*(arrays[f"{prefix}_{key}"] for key in _TRACK))

        def transform(key: str) -> Pose | None:
            numbers = about[key]
            return None if numbers is None else Pose(np.array(numbers[:3]), np.array(numbers[3:]))

        def arm(role: str) -> ArmPoses | None:
            if role not in about["arms"]:
                return None
            told = about["arms"][role]
            read = ArmPoses(
                role, track(role) if told["flange"] else None, tuple(told["joints"]),
                arrays[f"{role}_joint_time"], arrays[f"{role}_joint_position"], told["urdf"],
            )  # fmt: skip
            if not len(read.stamps):
                raise ValueError(f"its {role} has no poses")
            return read

        return PoseRecording(
            about["name"], about["source"], about["sha256"], track("seen"), arm("camera_arm"),
            arm("tool_arm"), transform("camera_in_flange"), transform("base_in_base"),
            transform("target_in_flange"), about["camera"], about["target"],
            timed=bool(about["timed"]), tolerances=PoseTolerances.from_mapping(about["tolerances"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path} is no recording of poses: {error}; import it again") from error


def load_pose_files(
    fit_paths: Sequence[Path], held_paths: Sequence[Path], tolerances: Path | None
) -> tuple[list[PoseRecording], list[PoseRecording], list[str]]:
    """Recordings by role, held-out data unseen, with notes; tolerances of a YAML file replace their own.

    Raises:
        InputError: as `read_pose_file`; files of another kind among them; held-out poses that are fitted.
    """
    stated = (PoseTolerances, tolerances)
    return pose_roles(*read_by_role(fit_paths, held_paths, SUFFIX, read_pose_file, stated))


def pose_roles(
    fit: list[PoseRecording], held: list[PoseRecording]
) -> tuple[list[PoseRecording], list[PoseRecording], list[str]]:
    """Recordings by role, a part held out where none is, with notes.

    Raises:
        InputError: held-out poses that are fitted, or too few to hold any out.
    """
    notes: list[str] = []
    if not held and not fit[0].timed and len(fit[0].seen) < LEAST_AT_REST:
        count = len(fit[0].seen)
        notes.append(f"{fit[0].name} is alone, and {count} poses are too few to hold any out: all are fitted")
        return fit, held, notes
    if not held:
        first, last = split_poses(fit[0])
        notes.append(f"{fit[0].name} is alone: a part of it is held out")
        return [first], [last], notes
    for unseen in held:
        for known in fit:
            same = np.isin(
                unseen.seen.position.view([("", float)] * 3), known.seen.position.view([("", float)] * 3)
            )
            check_unseen(float(same.mean()), _SAME, unseen.name, f"the fitted {known.name}", "poses")
    return fit, held, notes
