"""Pairs of poses as scripts keep them: a file or a folder per view, or matrices below each other."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.pose_importer import poses_of
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table

VIEWS = 12


def _matrix(rotation: Rotation, position: np.ndarray) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation.as_matrix(), position
    return out


def _pairs() -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Flanges in the base, and a board as a camera on them sees it."""
    rng = np.random.default_rng(4)
    camera = _matrix(Rotation.from_euler("xyz", [2, -3, 88], degrees=True), np.array([0.04, -0.085, 0.022]))
    board = _matrix(Rotation.from_rotvec([0, 0, 0.3]), np.array([0.45, 0.02, 0.0]))
    down = Rotation.from_euler("x", np.pi)
    flanges = [
        _matrix(
            down * Rotation.from_rotvec(rng.uniform(-0.5, 0.5, 3)),
            np.array([0.4, 0.0, 0.5]) + rng.uniform(-0.15, 0.15, 3),
        )
        for _ in range(VIEWS)
    ]
    return flanges, [np.linalg.inv(f @ camera) @ board for f in flanges]


def _text_per_view(folder: Path) -> None:
    for name, poses in zip(("robot", "board"), _pairs(), strict=True):
        for k, pose in enumerate(poses):
            np.savetxt(folder / f"{name}_{k:03d}.txt", pose, fmt="%.8f")


def _folder_per_view(folder: Path) -> None:
    for k, (flange, seen) in enumerate(zip(*_pairs(), strict=True)):
        (folder / f"pose_{k}").mkdir()
        rotation = Rotation.from_matrix(flange[:3, :3]).as_rotvec()
        pose = [*flange[:3, 3].tolist(), *rotation.tolist()]
        named = {"pose_flange": pose, "T_cam_tag": seen.tolist(), "taken": "2026-03-03"}
        (folder / f"pose_{k}" / "data.json").write_text(json.dumps(named))


def _stacked(folder: Path) -> None:
    for name, poses in zip(("robot", "board"), _pairs(), strict=True):
        np.savetxt(folder / f"{name}.txt", np.vstack(poses), fmt="%.8f")


def _imported(draft: Draft, folder: Path) -> PoseRecording:
    content = {key: value for key, value in draft.as_mapping().items() if key != "questions"}
    return poses_of(yaml.safe_dump(content), folder / "mapping.yaml", folder)[0].recording


@pytest.mark.parametrize("write", [_text_per_view, _folder_per_view, _stacked])
def test_pairs_are_drafted_however_they_were_kept(write: Callable[[Path], None], tmp_path: Path) -> None:
    write(tmp_path)
    draft = draft_any([tmp_path], None, None)
    assert draft.kind == "poses" and draft.poses["at_rest"]
    assert draft.closes_m < 1e-4
    assert not any("is it the target" in question or "in ms" in question for question in draft.questions)


def test_views_are_paired_by_their_number(tmp_path: Path) -> None:
    _text_per_view(tmp_path)
    draft = draft_any([tmp_path], None, None)
    (tmp_path / "robot_003.txt").unlink()
    (tmp_path / "board_007.txt").unlink()
    recording = _imported(draft, tmp_path)
    assert recording.seen.time.tolist() == [k for k in range(VIEWS) if k not in (3, 7)]


def test_a_view_with_other_numbers_is_named(tmp_path: Path) -> None:
    _text_per_view(tmp_path)
    (tmp_path / "board_005.txt").write_text("1 0 0\n")
    with pytest.raises(InputError, match=r"board_005.txt holds 3 numbers as 'board', board_000.txt 16"):
        read_table(tmp_path / "board_*.txt", CsvOptions(), "it")
    with pytest.raises(InputError, match=r"no file like .*tag_\*.txt"):
        read_table(tmp_path / "tag_*.txt", CsvOptions(), "it")


def test_half_a_matrix_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1 2\n3 4\n5 6\n")
    with pytest.raises(InputError, match=r"has 3 lines in 2 columns of numbers; csv.rows_per_sample is 2"):
        read_table(tmp_path / "a.txt", CsvOptions(delimiter=" ", header=False, rows_per_sample=2), "it")
