"""Logs in several folders are read where they lie, and not their namesakes in the first one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.any_draft import draft_free_devices
from samrl_ros.log_import.draft.places import name_by_path
from samrl_ros.recordings.reading_file import read_reading_file
from tests.recordings.draft.test_pose_draft import two_files
from tests.recordings.test_one_step import depth_log


def in_two_folders(folder: Path, first: str, second: str) -> tuple[Path, Path]:
    """Two depth logs, the second of which has a namesake beside the first."""
    monday, tuesday = folder / "monday", folder / "tuesday"
    monday.mkdir()
    tuesday.mkdir()
    depth_log(monday / second, 1, 1.0)
    return depth_log(monday / first, 2, 1.01), depth_log(tuesday / second, 3, 1.02)


def factor(recording: ReadingRecording) -> float:
    return float(np.median(recording.reading / recording.reference))


@pytest.mark.parametrize("second, names", [("b.csv", ["a", "b"]), ("a.csv", ["monday", "tuesday"])])
def test_a_file_is_not_its_namesake_in_the_first_folder(
    tmp_path: Path, second: str, names: list[str]
) -> None:
    made = read_devices(list(in_two_folders(tmp_path, "a.csv", second)), [])
    assert made is not None
    both = [*made.fit, *made.held_out]
    assert [each.name for each in both] == names
    np.testing.assert_allclose([factor(each) for each in both], [1.01, 1.02], atol=1e-3)


def test_a_drafted_mapping_names_the_files_where_they_lie(tmp_path: Path) -> None:
    logs = in_two_folders(tmp_path, "a.csv", "b.csv")
    mapping = tmp_path / "monday" / "mapping.yaml"
    assert run(["bag", "draft", *map(str, logs), "--out", str(mapping)]) == 0
    assert run(["bag", "import", str(mapping), "--out", str(tmp_path / "bags")]) == 0
    assert factor(read_reading_file(tmp_path / "bags" / "b.readings.npz")) == pytest.approx(1.02, abs=1e-3)


def test_a_robot_and_a_camera_with_a_folder_each(tmp_path: Path) -> None:
    """One name for both was read from the first folder twice."""
    robot, tag = two_files(tmp_path)
    apart = [tmp_path / "robot" / robot.name, tmp_path / "camera" / tag.name]
    for path, there in zip((robot, tag), apart, strict=True):
        there.parent.mkdir()
        path.rename(there)
    draft = draft_free_devices(apart)
    assert draft is not None and draft.kind == "poses"
    name_by_path(draft, apart, apart[0].parent)
    (recording,) = draft.recordings
    assert list(recording["files"].values()) == [str(apart[1].resolve())]
    alike = [path.with_name("log.csv") for path in apart]
    for path, there, device in zip(apart, alike, ("tcp", "tag"), strict=True):
        head, rows = path.read_text().split("\n", 1)
        time, *axes = head.split(",")
        there.write_text(",".join([time, *(f"{device}_{axis}" for axis in axes)]) + "\n" + rows)
    draft = draft_free_devices(alike)
    assert draft is not None and draft.kind == "poses"
    with pytest.raises(InputError, match=r"have one name.*give them different names"):
        name_by_path(draft, alike, alike[0].parent)
