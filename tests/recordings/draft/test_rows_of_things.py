"""Rows of numbered tags below each other, several numbers in one cell, two guesses of a pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.bodies import body_draft
from samrl_ros.log_import.draft.bodies.free_fall import FreeFall
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.text_layout import text_options
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table

COUNT, FRAMES = 60, 40


def draft_of_shoves(folder: Path) -> Draft:
    """Files of a box, tag 7, that slides in another direction each, amid a table's tags, 0 and 1."""
    rng = np.random.default_rng(3)
    for file, way in enumerate(((1.0, 0.0), (0.5, 1.0), (0.7, 0.7), (1.0, -0.6))):
        rows = ["timestamp,tag_id,x,y,z,roll,pitch,yaw"]
        for k in range(COUNT):
            s = 0.4 * (1 - (1 - k / COUNT) ** 2)
            for tag in rng.permutation([0, 1, 7]):
                place = np.array([s * way[0], s * way[1], 0.08] if tag == 7 else [0.6 * tag, 0.4, 0.0])
                cells = [*(place + rng.normal(0.0, 2e-4, 3)), *rng.normal(0.0, 0.4, 2), 30.0 * s * file]
                rows.append(f"{1.7e9 + 40 * file + k / 60:.4f},{tag}," + ",".join(f"{c:.5f}" for c in cells))
        rows.append(f"{1.7e9 + 40 * file + 1.1:.4f},413,0.1,0.2,0.3,0,0,0")  # taken for another tag once
        (folder / f"shove_{file}.csv").write_text("\n".join(rows))
    return draft_any([folder], None, None)


def test_the_tag_that_moves_amid_others_is_the_body(tmp_path: Path) -> None:
    """Rows of all tags were one body's, and their repeated stamps no time."""
    source = (drafted := draft_of_shoves(tmp_path)).sources["track"]
    assert drafted.kind == "bodies" and source["part"] == "7" and source["csv"] == {"label": "tag_id"}
    assert source["time"] == {"column": "timestamp", "unit": "s"}


def test_a_row_that_a_later_file_holds_twice_is_left_out(tmp_path: Path) -> None:
    """The first file decided, so that the mapping was refused."""
    draft_of_shoves(tmp_path)
    path = tmp_path / "shove_2.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:20], *rows[17:]]))  # three rows, one of each tag
    assert draft_any([tmp_path], None, None).sources["track"]["time"]["repeated"] == "drop"


def test_what_slows_down_in_a_plane_is_no_fall_in_an_unknown_unit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Friction slows as gravity does, along the plane that the box stays in."""
    slowed = FreeFall("", "s", axis=0, up=-1, gravity=3.0, lean=0.0, seconds=0.4)
    monkeypatch.setattr(body_draft, "find_unscaled_fall", lambda *_: slowed)
    assert not any("pixel" in question for question in draft_of_shoves(tmp_path).questions)


def test_degrees_of_a_later_file_are_degrees_and_are_asked_for(tmp_path: Path) -> None:
    """The first turns by less than a radian's full turn: they were written as rad, and nothing asked."""
    drafted = draft_of_shoves(tmp_path)
    assert drafted.bodies["track"]["angle_unit"] == "deg"
    assert any("are they in deg?" in question for question in drafted.questions)


@pytest.mark.parametrize("part", ["7", "12"])
def test_rows_of_a_number_are_read_by_it_as_it_is_written(tmp_path: Path, part: str) -> None:
    """A column of numbers held 7 as 7.0, and `part` had to name that."""
    path = tmp_path / "tags.csv"
    path.write_text("t,id,x\n0,7,0.7\n1,12,1.2\n")
    table = read_table(path, CsvOptions(label="id"), "the log", part)
    assert table.numbers("x", "") == [int(part) / 10]


def test_the_tag_seen_most_often_is_the_target_of_several_runs(tmp_path: Path) -> None:
    """UATag's logger: two guesses of each tag's pose, with zeros where nothing was seen."""
    rng = np.random.default_rng(4)
    mount = Rotation.from_rotvec([0.1, -0.2, 1.0])
    names = [f"c{c}_{n}" for c in (0, 1) for n in ("tx", "ty", "tz")]
    turns = [f"c{c}_r{i}{j}" for c in (0, 1) for i in range(3) for j in range(3)]
    for run in (1, 2):
        robot = ["timestamp," + ",".join(f"actual_TCP_pose_{k}" for k in range(6))]
        tags = ["timestamp,tag_id," + ",".join([*names[:3], *turns[:9], *names[3:], *turns[9:]])]
        for k in range(FRAMES):
            hand, place = Rotation.from_rotvec(rng.normal(0.0, 0.4, 3)), rng.normal(0.0, 0.2, 3)
            stamp = f"{1e9 + 1000 * run + 3 * k:.3f}"
            robot.append(",".join([stamp, *(f"{v:.9f}" for v in (*place, *hand.as_rotvec()))]))
            camera = hand * mount
            seen = camera.inv().apply(np.array([0.5, 0.1, 0.9]) - place - hand.apply([0.0, 0.05, 0.1]))
            for tag in (5, 12)[k % 3 > 0 :]:
                cells = (*(seen + 0.1 * (tag == 5)), *camera.inv().as_matrix().ravel())
                cells = np.zeros(12) if k % 10 == 7 else np.asarray(cells)
                tags.append(",".join([stamp, str(tag), *(f"{v:.9f}" for v in (*cells, *cells))]))
        (tmp_path / f"run{run}_rtde.csv").write_text("\n".join(robot))
        (tmp_path / f"run{run}_tags.csv").write_text("\n".join(tags))
    drafted = draft_any([tmp_path], None, None)
    assert drafted.sources["target"]["part"] == "12" and drafted.closes_m < 1e-3
    assert drafted.poses["target_in_camera"]["rotation_matrix"][0] == "c0_r00"
    assert any("12, and not" in question for question in drafted.questions)
    assert [each["name"] for each in drafted.recordings] == ["run1", "run2"]


def test_numbers_with_blanks_between_are_a_list_in_one_cell(tmp_path: Path) -> None:
    """As EPFL's air hockey publishes its hits; blanks were taken to part the columns."""
    rng = np.random.default_rng(5)
    rows = ["RosTime,PositionForIiwa7,OrientationForIiwa7"]
    for k in range(COUNT):
        place = np.array([0.5, 0.5 * k / COUNT, 0.28]) + rng.normal(0.0, 1e-4, 3)
        turn = Rotation.from_rotvec([0.0, 0.0, 0.3 * k / COUNT]).as_quat()
        cells = (" ".join(f"{v:.17g}" for v in place), "  ".join(f"{v:.17g}" for v in turn))
        rows.append(f"{1.7e9 + 0.005 * k:.7f}," + ",".join(cells))
    path = tmp_path / "object_1_hit_1.csv"
    path.write_text("\n".join(rows))
    assert text_options(path) == CsvOptions()
    drafted = draft_any([path], None, None)
    assert drafted.kind == "bodies" and drafted.bodies["track"]["position"] == "PositionForIiwa7"
    assert drafted.bodies["track"]["quaternion"] == "OrientationForIiwa7"
