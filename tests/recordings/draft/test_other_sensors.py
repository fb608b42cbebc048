"""Logs of sensors that tell no motion: an IMU's and corners in images were drafted as bodies and joints."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from samrl_core.common.errors import InputError
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables

RNG = np.random.default_rng(17)
FELT = RNG.normal(0.0, 0.5, (80, 3)) + [0.0, 3.0, 8.9]
TIME = 0.01 * np.arange(80)


def write(path: Path, head: str, numbers: np.ndarray) -> Path:
    lines = [",".join(f"{value:.9g}" for value in row) for row in numbers]
    path.write_text("\n".join([head, *lines] if head else lines))
    return path


@pytest.mark.parametrize(
    "name, head",
    [
        (
            "Raw Data.csv",
            '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"',
        ),
        ("Accelerometer.csv", '"Time (s)","X (m/s^2)","Y (m/s^2)","Z (m/s^2)"'),  # Phyphox
        ("Accelerometer.csv", "seconds_elapsed,z,y,x"),  # Sensor Logger
        ("Raw Data.csv", '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)"'),
        ("run.csv", "time,ax,ay,az"),
        ("imu0.csv", "#timestamp [s],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1]"),
    ],
)
def test_what_an_imu_feels_is_no_motion(tmp_path: Path, name: str, head: str) -> None:
    path = write(tmp_path / name, head, np.column_stack([TIME, FELT]))
    with pytest.raises(InputError, match=r"inertial sensor .*no position.*Record where it is"):
        draft_any([path], None, None)


def test_an_imu_beside_a_track_leaves_the_track(tmp_path: Path) -> None:
    write(tmp_path / "Accelerometer.csv", "seconds_elapsed,z,y,x", np.column_stack([TIME, FELT]))
    flown = np.column_stack([TIME, TIME, 4.0 * TIME - 4.905 * TIME**2])
    write(tmp_path / "ball.csv", "t,x,y", flown)
    tracks = [t for table in read_logged_tables([tmp_path]) for t in table.tracks()]
    assert [track.path.name for track in tracks] == ["ball.csv"]


@pytest.mark.parametrize(
    "name, head",
    [("ball.csv", "t,x,y,z"), ("imu_run.csv", "t,pos_x,pos_y,pos_z"), ("a.csv", "t,q,dq,ddq")],
)
def test_positions_are_no_imus(tmp_path: Path, name: str, head: str) -> None:
    path = write(tmp_path / name, head, np.column_stack([TIME, FELT]))
    assert read_logged_tables([path])[0].sensor == "none"


def corners(views: int = 9) -> np.ndarray:
    """View, id, x and y on the board [m], and x and y in the image [px], of four corners of each view."""
    board = np.array([[0.0, 0.0], [0.04, 0.0], [0.04, 0.04], [0.0, 0.04]])
    seen = [350.0 + 900.0 * board + [3.0 * k, k] for k in range(views)]
    return np.vstack([np.column_stack([np.full(4, k), np.arange(4), board, seen[k]]) for k in range(views)])


@pytest.mark.parametrize("head", ["timestamp_ns,corner_id,target_x,target_y,x,y", ""])
def test_corners_of_a_board_are_no_track(tmp_path: Path, head: str) -> None:
    path = write(tmp_path / "corners.csv", head, corners())
    with pytest.raises(InputError, match=r"corners\.csv: corners .* no pose.*solvePnP.*--export-poses"):
        draft_any([path], None, None)


def test_corners_of_tags_in_a_file_for_each_view_are_no_poses(tmp_path: Path) -> None:
    for k in range(9):
        square = [[180 + k, 130], [220 + k, 130], [220 + k, 170], [180 + k, 170]]
        tags = [{"id": number, "center": [200 + k, 150], "corners": square} for number in range(4)]
        (tmp_path / f"frame_{k}.json").write_text(json.dumps(tags))
    with pytest.raises(InputError, match=r"and 5 more: corners .*estimate_tag_pose=True"):
        draft_any([tmp_path], None, None)


def test_a_pose_beside_its_corners_is_read(tmp_path: Path) -> None:
    numbers = np.column_stack([TIME, FELT, 0.1 * FELT, 100.0 * FELT[:, :2]])
    path = write(
        tmp_path / "tag.csv", "t,tvec_x,tvec_y,tvec_z,rvec_x,rvec_y,rvec_z,corner_0_x,corner_0_y", numbers
    )
    (table,) = read_logged_tables([path])
    assert table.sensor == "none" and any(track.track.whole for track in table.tracks())
