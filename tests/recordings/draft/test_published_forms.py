"""Forms in which labs publish: scenes of BOP, groups of HDF5, seven joints, split stamps, frames of Vicon."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.poses.descriptions import is_inverse
from samrl_ros.log_import.draft.poses.pose_draft import side_of
from samrl_ros.log_import.draft.tracks.logged_tracks import read_logged_tables
from samrl_ros.log_import.draft.tracks.pose_tracks import find_positions
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.formats.json_log import read_json_table
from samrl_ros.log_import.pose_importer import poses_of
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.table import Table
from samrl_ros.log_import.tables import read_table

VIEWS = 9


def transforms(rng: np.random.Generator, spread: float) -> np.ndarray:
    """Random poses (VIEWS, 4, 4) around the origin [m]."""
    out = np.tile(np.eye(4), (VIEWS, 1, 1))
    out[:, :3, :3] = Rotation.from_rotvec(rng.normal(0.0, 0.6, (VIEWS, 3))).as_matrix()
    out[:, :3, 3] = rng.normal(0.0, spread, (VIEWS, 3))
    return out


def bop(pose: np.ndarray, letters: str) -> dict[str, list[float]]:
    """A transform as BOP writes it, in mm."""
    return {
        f"cam_R_{letters}": pose[:3, :3].ravel().tolist(),
        f"cam_t_{letters}": (1e3 * pose[:3, 3]).tolist(),
    }


def test_a_scene_of_bop_is_a_chain_whose_flange_is_the_camera(tmp_path: Path) -> None:
    """The world in the camera and the object in it; a list of one object by image; cam_K is neither."""
    rng = np.random.default_rng(2)
    world, thing = transforms(rng, 0.4), np.eye(4)
    thing[:3, 3] = 0.6, -0.1, 0.05
    intrinsics = [1075.0, 0.0, 641.0, 0.0, 1073.0, 507.0, 0.0, 0.0, 1.0]
    cameras = {
        str(k): {"cam_K": intrinsics, **bop(one, "w2c"), "depth_scale": 0.1} for k, one in enumerate(world)
    }
    objects = {str(k): [{**bop(one @ thing, "m2c"), "obj_id": 14}] for k, one in enumerate(world)}
    (tmp_path / "scene_camera.json").write_text(json.dumps(cameras))
    (tmp_path / "scene_gt.json").write_text(json.dumps(objects))
    draft = draft_any([tmp_path], None, None)
    assert draft.kind == "poses" and not draft.questions
    assert draft.poses["camera_arm"]["flange"]["inverse"]
    assert draft.poses["camera_in_flange"]["position"] == [0.0, 0.0, 0.0]
    (one,) = poses_of(as_yaml(draft), tmp_path / "m.yaml", tmp_path)
    assert closing_error(one.recording) < 1e-6


def test_a_trajectory_of_slam_is_the_camera_in_its_own_map(tmp_path: Path) -> None:
    """Taken before for a flange, and what carries the camera for a target that it sees."""
    rows = np.column_stack(
        [1.4e9 + np.arange(VIEWS), np.eye(VIEWS, 3), np.tile([0.0, 0.0, 0.6, 0.8], (VIEWS, 1))]
    )
    sides = {}
    for name in ("groundtruth", "CameraTrajectory", "stamped_vio"):
        np.savetxt(tmp_path / f"{name}.txt", rows, fmt="%.7f")
        (track,) = read_logged_tables([tmp_path / f"{name}.txt"])[0].tracks()
        sides[name] = side_of(track), is_inverse(track)
    assert sides == {"groundtruth": (0, False), "CameraTrajectory": (1, True), "stamped_vio": (1, True)}


def test_images_of_colmap_see_their_world_as_a_target(tmp_path: Path) -> None:
    """The robot's file beside it was a body that slides, and COLMAP's was passed over in silence."""
    names = [f"{k:03d}.png" for k in range(VIEWS)][::-1]
    rows = [f"{k + 1} 0.8 0.6 0 0 {k} 2 3 1 {name}\n\n" for k, name in enumerate(names)]
    head = "# Image list with two lines of data per image:\n#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, ...\n"
    (tmp_path / "images.txt").write_text(head + "".join(rows))
    (track,) = read_logged_tables([tmp_path])[0].tracks()
    assert track.track.whole and track.track.order == "xyzw" and side_of(track) == 1 and not is_inverse(track)
    assert track.position[:, 0].tolist() == list(range(VIEWS))[::-1]  # in the order of their names
    (tmp_path / "images.txt").write_text(head + "1 0.8 0.6 0 0 1 2 3\n\n")
    with pytest.raises(InputError, match="has 10 entries"):
        read_table(tmp_path / "images.txt", CsvOptions(), "the log")


def test_of_several_objects_in_an_image_none_is_taken_in_silence(tmp_path: Path) -> None:
    path = tmp_path / "scene_gt.json"
    path.write_text(json.dumps({str(k): [{"cam_t_m2c": [1.0, 2.0, 3.0]}] * 2 for k in range(VIEWS)}))
    assert not read_json_table(path, "", "the log").columns


def test_each_group_of_a_file_is_a_motion(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    time = np.arange(0.0, 0.4, 1.0 / 90.0)
    with h5py.File(tmp_path / "throws.hdf5", "w") as file:
        for k in range(2):
            height = 0.3 + (2.0 + 0.1 * k) * time - 0.5 * 9.81 * time**2
            group = file.create_group(f"originals/{k}")
            group["time_stamps"], group["positions"] = (
                7.0 * k + time,
                np.stack([time, 0.0 * time, height], axis=1),
            )
    draft = draft_any([tmp_path / "throws.hdf5"], None, None)
    assert draft.kind == "bodies" and not draft.questions
    assert draft.sources["track"]["part"] == "{name}"
    assert [one["name"] for one in draft.recordings] == [f"originals/{k}" for k in range(2)]


def test_seven_joints_are_no_pose_and_nine_intrinsics_no_rotation() -> None:
    rng, table = np.random.default_rng(4), Table(Path("session.mat"))
    table.columns = {"q_deg": rng.normal(0.0, 40.0, (VIEWS, 7)), "cam_K": np.tile(np.arange(9.0), (VIEWS, 1))}
    assert not find_positions(table)
    quaternions = Rotation.random(VIEWS, random_state=1).as_quat()
    table.columns = {"pose": np.hstack([rng.normal(0.0, 1.0, (VIEWS, 3)), quaternions])}
    assert find_positions(table)[0].whole


def test_a_trigger_beside_a_split_stamp_and_its_exposure_are_two_clocks(tmp_path: Path) -> None:
    count = np.arange(200)
    trigger = 1_718_960_403 * 10**9 + count * 50_000_000
    stamp = trigger + 4_000_000 + count * 2000
    rows = zip(count, trigger, stamp // 10**9, stamp % 10**9, 8000 + 40 * (-1) ** count, strict=True)
    lines = ["seq,trigger_ptp_ns,header_stamp_sec,header_stamp_nanosec,exposure_us"]
    (tmp_path / "cam.csv").write_text("\n".join([*lines, *(",".join(map(str, row)) for row in rows)]) + "\n")
    draft = draft_any([tmp_path / "cam.csv"], None, None)
    assert draft.kind == "readings" and not draft.questions
    assert draft.readings["reading"] == "(device + 1e-09 * device_rest)"
    assert draft.sources["log"]["columns"]["host"] == "trigger_ptp_ns"


def test_the_first_frame_of_vicon_is_its_time_zero(tmp_path: Path) -> None:
    """A chain with a camera that the same trigger started was a frame off."""
    head = ["Objects", "100", ",,rig,,,,,", "Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ", ",,deg,deg,deg,mm,mm,mm"]
    rows = [f"{k},0,1.0,2.0,3.0,{k}.5,0.5,1.5" for k in range(1, 30)]
    (tmp_path / "trial.csv").write_text("\n".join([*head, *rows]) + "\n")
    time = read_table(tmp_path / "trial.csv", CsvOptions(), "the log").time
    assert time is not None and time[0] == 0.0 and abs(time[1] - 0.01) < 1e-12
