"""Logs in several folders are read where they lie, and not their namesakes in the first one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from samrl_core.cell.types.reading_recording import ReadingRecording
from samrl_core.common.errors import InputError
from samrl_ros.cli.main import run
from samrl_ros.log_import.devices import read_devices
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.places import name_by_path
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables
from samrl_ros.recordings.reading_file import read_reading_file
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
    apart = []
    for name, source in (("robot", "ee"), ("camera", "tag")):
        (tmp_path / name).mkdir()
        head = ",".join(f"{source}_{axis}" for axis in "x y z qx qy qz qw".split())
        rows = np.tile([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0], (60, 1)) + 0.01 * np.arange(60)[:, None]
        np.savetxt(tmp_path / name / "log.csv", rows, delimiter=",", header=head, comments="")
        apart.append(tmp_path / name / "log.csv")
    one, other = (track for table in read_logged_tables(apart) for track in table.tracks())
    assert one.place != other.place
    alike = Draft("", sources={"target": {"file": "log.csv"}, "flange": {"file": "log.csv"}})
    alike.recordings = [{"name": "log"}]
    with pytest.raises(InputError, match=r"have one name.*give them different names"):
        name_by_path(alike, apart, apart[0].parent)
    tag = apart[1].rename(tmp_path / "camera" / "tag.csv")
    named = Draft("", sources={"target": {"file": "tag.csv"}, "flange": {"file": "log.csv"}})
    named.recordings = [{"name": "log"}]
    name_by_path(named, [apart[0], tag], apart[0].parent)
    assert named.recordings == [{"name": "log", "files": {"target": str(tag.resolve())}}]
