"""What the terminal says about recordings, and which bags a folder stands for."""

from __future__ import annotations

from pathlib import Path

from samrl_core.diagnosis.report.words import points
from samrl_ros.cli.diagnosis.notes import together
from samrl_ros.log_import.draft.bag_set import bags_in


def test_a_note_of_several_recordings_is_shown_once() -> None:
    notes = [
        "a: joints: by name",
        "a: 3 gaps",
        "the load is known",
        "b: joints: by name",
        "b: joints: by name",
    ]
    assert together(notes) == ["a, b: joints: by name", "a: 3 gaps", "the load is known"]


def _bag(folder: Path) -> Path:
    folder.mkdir()
    (folder / "metadata.yaml").touch()
    return folder


def test_a_folder_of_bag_folders_stands_for_its_bags(tmp_path: Path) -> None:
    bags = [_bag(tmp_path / name) for name in ("monday", "tuesday")]
    (tmp_path / "arm.urdf").touch()
    (tmp_path / "tolerances.yaml").touch()
    (tmp_path / "report").mkdir()
    assert bags_in(tmp_path) == bags
    assert not bags_in(bags[0])
    (tmp_path / "log.csv").touch()  # then the folder's own logs are meant, as before
    assert not bags_in(tmp_path)


def test_a_difference_of_nothing_has_no_sign() -> None:
    assert [points(x) for x in (-0.001, 0.004, 0.31, -0.05)] == [
        "0 points",
        "0 points",
        "+31 points",
        "-5 points",
    ]
