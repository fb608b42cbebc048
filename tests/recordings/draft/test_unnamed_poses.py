"""Pairs of poses in files without headers, and names that say frames by letters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseTrack
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_ros.log_import.draft.any_draft import draft_any
from tests.diagnosis.poses.pose_worlds import PoseWorld, record

VIEWS = 12


def made() -> tuple[PoseTrack, PoseTrack]:
    """The target in a camera that rides on the arm, and the flange in its base, at rest."""
    recording = record(PoseWorld(at_rest=True, seconds=8.0))
    assert recording.camera_arm is not None and recording.camera_arm.flange is not None
    seen, flange = recording.seen, recording.camera_arm.flange
    return first_views(seen), first_views(flange)


def first_views(track: PoseTrack) -> PoseTrack:
    return PoseTrack(track.time[:VIEWS], track.position[:VIEWS], track.quat_xyzw[:VIEWS])


def rotation_vectors(track: PoseTrack) -> np.ndarray:
    return Rotation.from_quat(track.quat_xyzw).as_rotvec()


def matrices(track: PoseTrack) -> np.ndarray:
    """(N, 16), column by column."""
    return np.swapaxes(rigid.transforms(track.position, track.quat_xyzw), 1, 2).reshape(-1, 16)


def rows_of(track: PoseTrack, kind: str) -> np.ndarray:
    """(N, K) without names."""
    if kind == "matrix":
        return matrices(track)
    if kind == "quaternion_first":
        return np.hstack([track.quat_xyzw, track.position])
    turned = rotation_vectors(track)
    both = [turned, track.position] if kind == "counted_angles_first" else [track.position, turned]
    count = np.arange(1.0, len(turned) + 1) + (np.arange(len(turned)) > 2)  # 1, 2, 3, 5, ...: one was lost
    return np.column_stack([count, *both]) if kind.startswith("counted") else np.hstack(both)


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("matrix", ("arm_poses", "pattern_poses")),
        ("quaternion_first", ("bh", "sc")),
        ("counted_angles_first", ("gripper2base", "target2cam")),
        ("counted_positions", ("bh", "sc")),
    ],
)
def test_two_files_without_headers_are_pairs_where_they_close_a_chain(
    kind: str, names: tuple[str, str], tmp_path: Path
) -> None:
    seen, flange = made()
    paths = []
    for name, track in zip(names, (flange, seen), strict=True):
        np.savetxt(tmp_path / f"{name}.csv", rows_of(track, kind), delimiter=",", fmt="%.7f")
        paths.append(tmp_path / f"{name}.csv")

    draft = draft_any(paths, None, None)

    assert draft.kind == "poses" and draft.poses["at_rest"] and "camera_arm" in draft.poses
    assert draft.closes_m < 0.005
    assert not any("time" in source for source in draft.sources.values())
    if names[0] == "gripper2base":
        assert draft.questions == []


def test_two_trackers_without_headers_whose_stamps_hold_twelve_digits(tmp_path: Path) -> None:
    """Stamps of 10 ms repeat, a logger writes rows twice: the time was a body's first column, or none."""
    rng = np.random.default_rng(4)
    for number in (1, 2):
        recording = record(PoseWorld(seconds=8.0), seed=number)
        assert recording.camera_arm is not None and recording.camera_arm.flange is not None
        for name, track in (("left", recording.camera_arm.flange), ("right", recording.seen)):
            twice = np.repeat(np.arange(len(track)), 1 + (rng.random(len(track)) < 0.1))
            rows = np.column_stack([track.time, track.position, track.quat_xyzw])[twice]
            lines = [
                ", ".join([f"{1491416948.65 + row[0]:.12g}", *(f"{v:.9g}" for v in row[1:])]) for row in rows
            ]
            (tmp_path / f"run{number}_{name}.csv").write_text("\n".join(lines) + "\n")

    draft = draft_any([tmp_path], None, None)

    assert draft.kind == "poses" and [each["name"] for each in draft.recordings] == ["run1", "run2"]
    assert {source["file"] for source in draft.sources.values()} == {"{name}_left.csv", "{name}_right.csv"}
    for source in draft.sources.values():
        assert source["time"] == {"column": "0", "unit": "s", "repeated": "drop"}
    assert draft.closes_m < 0.01


def test_rows_of_two_files_that_close_no_chain_are_no_pairs(tmp_path: Path) -> None:
    seen, flange = made()
    np.savetxt(tmp_path / "a.txt", rows_of(flange, "positions_first"), fmt="%.7f")
    np.savetxt(tmp_path / "b.txt", rows_of(seen, "positions_first")[::-1], fmt="%.7f")
    assert draft_any([tmp_path / "a.txt", tmp_path / "b.txt"], None, None).kind == "bodies"


def test_letters_of_frames_around_p_and_q_are_read(tmp_path: Path) -> None:
    seen, flange = made()
    names = [f"B_tcp_{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")]
    names += [f"C_p_O_{axis}" for axis in "xyz"] + [f"C_q_O_{axis}" for axis in "xyzw"]
    numbers = [flange.position, rotation_vectors(flange), seen.position, seen.quat_xyzw]
    path = tmp_path / "samples.csv"
    np.savetxt(path, np.hstack(numbers), delimiter=",", header=",".join(names), comments="", fmt="%.7f")

    draft = draft_any([path], None, None)

    assert draft.poses["target_in_camera"]["quaternion"] == [f"C_q_O_{axis}" for axis in "xyzw"]
    assert draft.poses["camera_arm"]["flange"]["rotation_vector"] == ["B_tcp_rx", "B_tcp_ry", "B_tcp_rz"]
    assert len(draft.questions) == 1  # whether B_tcp is the tool in the base


def test_a_motor_log_without_names_is_no_track_and_the_remedy_is_said(tmp_path: Path) -> None:
    time = np.linspace(0.0, 1.0, 40)
    rows = np.column_stack([np.full(40, -100.0), time, -600 * (1 - np.exp(-8 * time)), -600 * time])
    np.savetxt(tmp_path / "step.csv", rows, delimiter=";", fmt="%.5f")
    with pytest.raises(InputError, match=r"holds 40 rows: joints need 50.*in a first line"):
        draft_any([tmp_path / "step.csv"], None, None)
