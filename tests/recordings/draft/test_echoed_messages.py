"""Columns that no header names: rows of `ros2 topic echo --csv`, and matrices under their number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.echoed_messages import echoed_names
from samrl_ros.log_import.draft.text_layout import text_options
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.pose_importer import poses_of

VIEWS = 24
RUNS = ("monday", "tuesday")
TARGET = np.eye(4)  # in the flange
TARGET[:3, 3] = 0.01, -0.02, 0.06


def chain(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Flange in its base, and what it carries in a still camera (VIEWS, 4, 4) [m]."""
    hand = np.tile(np.eye(4), (VIEWS, 1, 1))
    hand[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, 0.5, (VIEWS, 3))).as_matrix()
    hand[:, :3, 3] = [0.4, 0.0, 0.4] + rng.normal(0.0, 0.15, (VIEWS, 3))
    camera = np.eye(4)
    camera[:3, :3] = Rotation.from_rotvec([0.3, 2.0, 0.4]).as_matrix()
    camera[:3, 3] = 1.3, 0.1, 0.7
    return hand, np.linalg.inv(camera) @ hand @ TARGET


def write_echo(path: Path, poses: np.ndarray, begin: int, *frames: str) -> None:
    path.parent.mkdir(exist_ok=True)
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    rows = [
        ",".join([str(begin + 3 * k), "20", *frames, *(f"{v:.9f}" for v in (*pose[:3, 3], *turn))])
        for k, (pose, turn) in enumerate(zip(poses, quaternions, strict=True))
    ]
    path.write_text("\n".join(rows))


@pytest.mark.parametrize("transforms", [False, True])
def test_echoed_poses_in_a_folder_for_each_run_leave_nothing_to_ask(tmp_path: Path, transforms: bool) -> None:
    """Rows without a header had no names, and a folder of folders held no log."""
    rng = np.random.default_rng(6)
    for k, run in enumerate(RUNS):
        hand, seen = chain(rng)
        child, other = (["tool0"], ["board"]) if transforms else ([], [])
        write_echo(tmp_path / run / "tcp_pose.csv", hand, 1_700_000_000 + 900 * k, "base_link", *child)
        write_echo(
            tmp_path / run / "charuco_pose.csv", seen, 1_700_000_000 + 900 * k, "camera_optical_frame", *other
        )
    drafted = draft_any([tmp_path], None, None)
    assert not drafted.questions and "tool_arm" in drafted.poses
    assert [(r["name"], r["role"]) for r in drafted.recordings] == [
        ("monday", "fit"),
        ("tuesday", "held_out"),
    ]
    found = poses_of(as_yaml(drafted), tmp_path / "m.yaml", tmp_path)
    assert len(found) == 2 and all(closing_error(each.recording) < 1e-6 for each in found)


def test_a_row_that_a_later_run_holds_twice_is_left_out(tmp_path: Path) -> None:
    """The first run decided, so that a draft without a question was refused as a mapping."""
    rng = np.random.default_rng(9)
    for k, run in enumerate(RUNS):
        hand, seen = chain(rng)
        write_echo(tmp_path / run / "tcp_pose.csv", hand, 1_700_000_000 + 900 * k, "base_link")
        write_echo(tmp_path / run / "charuco_pose.csv", seen, 1_700_000_000 + 900 * k, "camera")
    path = tmp_path / RUNS[1] / "charuco_pose.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:5], *rows[4:]]))
    drafted = draft_any([tmp_path], None, None)
    assert drafted.sources["target"]["time"]["repeated"] == "drop"
    assert "repeated" not in drafted.sources["flange"]["time"]
    assert len(poses_of(as_yaml(drafted), tmp_path / "m.yaml", tmp_path)) == 2


@pytest.mark.parametrize(
    "row",
    [
        ["1", "2", "3", "0", "0", "0", "0", "0", "0", "1"],  # no frame
        ["1", "2", "base", "0", "0", "0", "0", "0", "0", "2"],  # no quaternion
        ["1.5", "2", "base", "0", "0", "0", "0", "0", "0", "1"],  # no whole seconds
    ],
)
def test_other_rows_of_ten_cells_are_no_echoed_pose(row: list[str]) -> None:
    assert not echoed_names([row] * 3)
    assert echoed_names([["1", "2", "base", "0", "0", "0", "0", "0", "0", "1"]] * 3)


def test_folders_with_other_files_are_no_runs(tmp_path: Path) -> None:
    hand, seen = chain(np.random.default_rng(7))
    write_echo(tmp_path / "a" / "tcp_pose.csv", hand, 1_700_000_000, "base_link")
    write_echo(tmp_path / "b" / "charuco_pose.csv", seen, 1_700_000_000, "camera")
    with pytest.raises(InputError, match="holds no log"):
        draft_any([tmp_path], None, None)


def test_matrices_under_their_number_are_views(tmp_path: Path) -> None:
    """As OpenCV's test data of robot-world calibration; their number was a line of names."""
    hand, seen = chain(np.random.default_rng(8))
    for name, poses in (("robot_cali", hand), ("board_cali", seen)):
        scaled = poses.copy()
        scaled[:, :3, 3] *= 1e3
        blocks = "\n\n".join("\n".join(" ".join(f"{v:.6f}" for v in row) for row in one) for one in scaled)
        (tmp_path / f"{name}.txt").write_text(f"{VIEWS}\n{blocks}\n\n")
    assert text_options(tmp_path / "robot_cali.txt").skip_lines == 1
    drafted = draft_any([tmp_path], None, None)
    assert drafted.poses["at_rest"] and drafted.poses["target_in_camera"]["unit"] == "mm"
    assert drafted.closes_m < 1e-5
