"""Recordings of bodies in files: arrays with one JSON text, written whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.types.body_recording import BodyModel, BodyRecording, BodyTolerances, BodyTrack, Support
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.kinds.bodies.body_tracks import split_bodies
from samrl_ros.recordings.arrays_by_role import (
    check_unseen,
    read_by_role,
    read_described,
    write_described,
)

SUFFIX = ".body.npz"
VERSION = 1
_ARRAYS = ("time", "position", "quat_xyzw")
_TEXTS = ("name", "source", "sha256", "camera", "phase")
_SAME = 0.05  # share of held-out poses found in the fitted ones from which on they are the same


def is_body_file(path: Path) -> bool:
    """Whether a path is named like a recording of a body."""
    return path.name.endswith(SUFFIX)


def write_body_file(recording: BodyRecording, path: Path) -> None:
    """Write a recording; an existing file is replaced."""
    about: dict[str, Any] = {
        "version": VERSION,
        "tolerances": asdict(recording.tolerances),
        "body": asdict(recording.body),
    }
    about |= {key: getattr(recording, key) for key in _TEXTS}
    about |= {"axes": recording.track.axes, "turns": recording.track.turns, "gravity": recording.gravity}
    about["support"] = None if recording.support is None else asdict(recording.support)
    arrays = {key: np.asarray(getattr(recording.track, key)) for key in _ARRAYS}
    write_described(path, about, arrays)


def read_body_file(path: Path) -> BodyRecording:
    """Read a recording.

    Raises:
        InputError: the file is damaged, of another version or none of a body.
    """
    try:
        arrays, about = read_described(path, VERSION)
        name, source, sha256, camera, phase = (str(about[key]) for key in _TEXTS)
        time, position, quats = (arrays[key] for key in _ARRAYS)
        track = BodyTrack(time, position, str(about["axes"]), quats, str(about["turns"]))
        if len(track) < 2:
            raise InputError(f"{path} holds {len(track)} poses, at least 2 are needed; import it again")
        body: dict[str, Any] = {k: _whole(v) for k, v in about["body"].items()}
        support = None
        if about["support"] is not None:
            plane: dict[str, Any] = {k: _whole(v) for k, v in about["support"].items()}
            support = Support(**plane)
        x, y, z = (float(g) for g in about["gravity"])
        return BodyRecording(
            name, source, sha256, track, BodyModel(**body), support, (x, y, z), camera, phase,
            BodyTolerances.from_mapping(about["tolerances"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path} is no recording of a body: {error}; import it again") from error


def load_body_files(
    fit_paths: Sequence[Path], held_paths: Sequence[Path], tolerances: Path | None
) -> tuple[list[BodyRecording], list[BodyRecording], list[str]]:
    """Recordings by role, held-out data unseen, with notes; tolerances of a YAML file replace their own.

    Raises:
        InputError: as `read_body_file`; files of another kind; held-out poses that were fitted.
    """
    stated = (BodyTolerances, tolerances)
    return body_roles(*read_by_role(fit_paths, held_paths, SUFFIX, read_body_file, stated))


def body_roles(
    fit: list[BodyRecording], held: list[BodyRecording]
) -> tuple[list[BodyRecording], list[BodyRecording], list[str]]:
    """Recordings by role, a part held out where none is, with notes.

    Raises:
        InputError: held-out poses that were fitted, or too few to hold any out.
    """
    if not held:
        fit, held, note = split_bodies(fit)
        return fit, held, [note]
    known = _poses(fit)
    for unseen in held:
        share = float(np.isin(_poses([unseen]), known).mean())
        check_unseen(share, _SAME, unseen.name, "the fitted ones", "poses")
    return fit, held, []


def _whole(value: Any) -> Any:
    """JSON's lists as the tuples that they were."""
    return tuple(value) if isinstance(value, list) else value


def _poses(recordings: Sequence[BodyRecording]) -> np.ndarray:
    """Stamps and positions (N,) of all of them as one comparable record each."""
    rows = [np.column_stack([r.track.time, r.track.position]) for r in recordings]
    return np.ascontiguousarray(np.concatenate(rows)).view([("", float)] * 4)[:, 0]
