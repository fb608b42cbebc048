"""Recordings of poses, bodies and readings: imported files, or logs of other tools in one step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from samrl_core.cell.types.body_recording import BodyTolerances
from samrl_core.cell.types.pose_recording import PoseTolerances
from samrl_core.cell.types.reading_recording import ReadingTolerances
from samrl_core.diagnosis.kinds.kind import Recording
from samrl_ros.recordings.arrays_by_role import restated
from samrl_ros.recordings.body_file import body_roles, is_body_file, load_body_files
from samrl_ros.recordings.pose_file import is_pose_file, load_pose_files, pose_roles
from samrl_ros.recordings.reading_file import is_reading_file, load_reading_files, reading_roles

Loaded = tuple[Sequence[Recording], Sequence[Recording], list[str]]  # fitted, held out, notes


def load_device_files(
    fit: Sequence[Path], held_out: Sequence[Path], tolerances: Path | None
) -> Loaded | None:
    """Imported recordings; None where there are none among the files.

    Raises:
        InputError: files of several kinds, damaged ones, or held-out data that were fitted.
    """
    for is_file_of, load in (
        (is_pose_file, load_pose_files),
        (is_reading_file, load_reading_files),
        (is_body_file, load_body_files),
    ):
        if any(is_file_of(path) for path in (*fit, *held_out)):
            return load(fit, held_out, tolerances)
    return None


def load_device_logs(
    logs: Sequence[Path], held_out: Sequence[Path], tolerances: Path | None
) -> Loaded | None:
    """Logs by drafted mappings; None of logs of joints.

    Args:
        logs: of one recording or several, in the user's order.
        held_out: never fitted.
        tolerances: a file of those of the kind.

    Raises:
        InputError: something about them is not sure, they cannot be read, or held-out data were fitted.
    """
    from samrl_ros.log_import.devices import read_devices

    found = read_devices(logs, held_out)
    if found is None:
        return None
    kind, divide = {
        "poses": (PoseTolerances, pose_roles),
        "bodies": (BodyTolerances, body_roles),
        "readings": (ReadingTolerances, reading_roles),
    }[found.kind]
    fit, held, notes = divide(*restated(found.fit, found.held_out, (kind, tolerances)))
    return fit, held, [*found.notes, *notes]
