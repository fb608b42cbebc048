"""Recordings of poses, of readings and of bodies: their files, what stands in them, and their mappings."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from samrl_core.cell.types.body_recording import BodyModel, BodyRecording, BodyTrack, Support
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.array_file import unpacked, write_arrays
from samrl_core.diagnosis.kinds.kinds import kind_of
from samrl_ros.log_import.any_importer import import_any
from samrl_ros.recordings.arrays_by_role import ABOUT
from samrl_ros.recordings.body_file import load_body_files, write_body_file
from samrl_ros.recordings.pose_file import load_pose_files, write_pose_file
from samrl_ros.recordings.reading_file import load_reading_files, write_reading_file
from tests.fuzz.reader import Reader

COUNT = 60  # poses or readings, enough to be split into fitted and held-out ones
COLUMNS = ("t", "x", "y", "z", "a", "b", "c", "w")


def _table() -> np.ndarray:
    """Stamps, positions and unit quaternions (COUNT, 8) of a body on a parabola that turns."""
    time = np.arange(COUNT) / 60.0
    turned = np.column_stack([np.sin(time), 0 * time, 0 * time, np.cos(time)])
    fallen = 2.0 + 4.0 * time - 0.5 * 9.81 * time**2
    return np.round(np.column_stack([time, 0.5 * time, 0.1 * np.sin(9 * time), fallen, turned]), 5)


def _tracks() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    table = _table()
    return table[:, 0], table[:, 1:4], table[:, 4:] / np.linalg.norm(table[:, 4:], axis=1, keepdims=True)


def _body(path: Path) -> None:
    time, position, quats = _tracks()
    body = BodyModel("cube", "box", (0.1, 0.1, 0.1), 0.3, (1e-3, 1e-3, 1e-3))
    track = BodyTrack(time, position, "xyz", quats, "xyz")
    write_body_file(BodyRecording("a", "log.csv", "0" * 64, track, body, Support(friction=0.3)), path)


def _poses(path: Path) -> None:
    track = PoseTrack(*_tracks())
    arm = ArmPoses("camera_arm", track)
    still = Pose(np.array([0.1, 0.0, 0.2]), np.array([0.0, 0.0, 0.0, 1.0]))
    write_pose_file(PoseRecording("a", "log.csv", "0" * 64, track, arm, None, still, still, None), path)


def _readings(path: Path) -> None:
    time, _, _ = _tracks()
    seen = 0.4 + np.round(0.3 * np.floor(4.0 * time), 3)
    write_reading_file(
        ReadingRecording("a", "log.csv", "0" * 64, "depth", "camera", time, 1.01 * seen, seen), path
    )


@dataclass(frozen=True)
class _Kind:
    name: str
    suffix: str
    write: Callable[[Path], None]
    load: Callable[[list[Path], list[Path], Path | None], tuple[list[Any], list[Any], list[str]]]
    mapping: dict[str, Any]  # its own key of a mapping


_POSE = {"position": ["x", "y", "z"], "quaternion": ["a", "b", "c", "w"]}
_KINDS = (
    _Kind(
        "bodies", ".body.npz", _body, load_body_files,
        {
            "bodies": {
                "body": {"name": "cube", "box": [100, 100, 100], "unit": "mm", "mass": 0.3},
                "track": {**_POSE, "unit": "m", "order": "xyzw"},
                "support": {"normal": [0, 0, 1], "friction": 0.3, "restitution": 0.5},
                "gravity": [0, 0, -9.81],
            },
            "tolerances": {"tilt": 0.01},
            "time_range": [0, None],
        },
    ),
    _Kind(
        "poses", ".poses.npz", _poses, load_pose_files,
        {
            "poses": {
                "target_in_camera": _POSE,
                "camera_arm": {"flange": {**_POSE, "inverse": True}},
                "camera_in_flange": {"position": [0, 0, 1], "quaternion": [0, 0, 0, 1]},
                "target_in_base": {"position": [0.4, 0, 0], "rpy": [0, 0, 90], "angle_unit": "deg"},
            },
            "tolerances": {"stamp": 0.001},
        },
    ),
    _Kind(
        "readings", ".readings.npz", _readings, load_reading_files,
        {
            "readings": {"quantity": "depth", "reading": "1.01 * z", "reference": "abs(z) + 1", "unit": "mm"},
            "tolerances": {"depth_scale": 0.001},
        },
    ),
)  # fmt: skip


def _log() -> bytes:
    text = io.StringIO()
    np.savetxt(text, _table(), delimiter=",", header=",".join(COLUMNS), comments="", fmt="%.6g")
    return text.getvalue().encode()


def _mapping_of(kind: _Kind) -> bytes:
    source = {"file": "log.csv", "time": {"column": "t"}, "columns": {c: c for c in COLUMNS[1:]}}
    content = {"recordings": [{"name": "one"}], **kind.mapping, "sources": {"log": source}}
    return yaml.safe_dump(content, sort_keys=False).encode()


def _import(kind: _Kind, path: Path) -> None:
    (path.parent / "log.csv").write_bytes(_log())
    import_any(path, path.parent, None)


def _file_of(kind: _Kind) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{kind.suffix}"
        kind.write(path)
        return path.read_bytes()


def _content_of(kind: _Kind) -> bytes:
    """What stands in a file, as JSON, so that damage passes the archive's checksums."""
    arrays = unpacked(_file_of(kind), Path("a"))
    about = json.loads(bytes(arrays.pop(ABOUT)))
    return json.dumps({"about": about, "arrays": {k: v.tolist() for k, v in arrays.items()}}).encode()


def _load(kind: _Kind, path: Path) -> None:
    """As `samrl diagnose` begins."""
    fit, held_out, _ = kind.load([path], [], None)
    of = kind_of(fit)
    fit, _ = of.alike(fit)
    of.trials(fit, held_out)


def _load_content(kind: _Kind, path: Path) -> None:
    file = path.with_name(f"a{kind.suffix}")
    try:
        content = json.loads(path.read_bytes())
        about = np.frombuffer(json.dumps(content["about"]).encode(), dtype=np.uint8)
        write_arrays(file, {**{k: np.array(v) for k, v in dict(content["arrays"]).items()}, ABOUT: about})
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OSError):
        return  # no archive that anybody could have written
    _load(kind, file)


def _readers() -> Iterator[Reader]:
    for kind in _KINDS:
        yield Reader(
            f"file of {kind.name}", f"a{kind.suffix}", lambda kind=kind: [_file_of(kind)],
            partial(_load, kind), share=0.3,
        )  # fmt: skip
        yield Reader(
            f"content of {kind.name}", "content.json", lambda kind=kind: [_content_of(kind)],
            partial(_load_content, kind),
        )  # fmt: skip
        yield Reader(
            f"mapping of {kind.name}", "m.yaml", lambda kind=kind: [_mapping_of(kind)],
            partial(_import, kind),
        )  # fmt: skip


OTHER_KINDS = tuple(_readers())
