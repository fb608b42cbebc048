"""Drafts of logs in usual conventions: matrices by columns, KUKA's angles, bags in a folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.log_import.body_importer import bodies_of
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft, Effort
from samrl_ros.log_import.draft.tracks.matrix_columns import matrix_order, row_by_row
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.pose_importer import poses_of
from tests.diagnosis.bodies.body_worlds import World, several, toss
from tests.diagnosis.poses.pose_worlds import CAMERA, RATE_HZ, TARGET, PoseWorld, flange, record
from tests.diagnosis.worlds import HOME, JOINTS, URDF

SEEN_NAMES = "stamp,tag_pos_x_mm,tag_pos_y_mm,tag_pos_z_mm,tag_qw,tag_qx,tag_qy,tag_qz"


def drafted(*paths: Path) -> Draft:
    return draft_any(paths, None, None)


def save(path: Path, names: str, *columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.9f")


def save_tag(folder: Path) -> np.ndarray:
    """Detections of a tag with w first and in mm; the flange's poses (N, 4, 4) at its stamps."""
    made = record(PoseWorld(seconds=12.0)).seen
    quaternions = made.quat_xyzw[:, [3, 0, 1, 2]]
    save(folder / "tag.csv", SEEN_NAMES, made.time, 1e3 * made.position, quaternions)
    return flange(np.arange(len(made.time)) / RATE_HZ, PoseWorld(seconds=12.0))


@pytest.mark.parametrize("width", [12, 16])
@pytest.mark.parametrize("order", ["rows", "columns"])
def test_numbers_of_a_matrix_tell_their_order(width: int, order: str) -> None:
    turns = Rotation.random(5, random_state=1).as_matrix()
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = turns, [0.3, -0.2, 1.4]
    rows = matrices[:, : width // 4]
    numbers = (rows if order == "rows" else np.swapaxes(rows, 1, 2)).reshape(5, width)
    assert matrix_order(numbers) == order
    np.testing.assert_allclose(numbers[:, row_by_row(width, order)], rows.reshape(5, width))
    assert matrix_order(numbers + 0.1) == ""


def test_a_column_major_matrix_is_taken_row_by_row(tmp_path: Path) -> None:
    """libfranka's O_T_EE; without it the tag alone was a body that falls."""
    poses = save_tag(tmp_path)
    numbers = np.swapaxes(poses, 1, 2).reshape(-1, 16)
    names = ",".join(["time_s", *(f"O_T_EE_{k}" for k in range(16))])
    save(tmp_path / "franka.csv", names, np.arange(len(poses)) / RATE_HZ, numbers)
    draft = drafted(tmp_path)
    assert draft.kind == "poses"
    listed = draft.poses["camera_arm"]["flange"]["matrix"]
    assert listed[:5] == ["O_T_EE_0", "O_T_EE_4", "O_T_EE_8", "O_T_EE_12", "O_T_EE_1"]
    assert draft.poses["target_in_camera"]["order"] == "xyzw"  # as the formulas stand, by the names


def test_tosses_in_bags_of_one_folder_are_motions_of_one_body(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = "Pose Point Quaternion PoseStamped".split()
    pose, point, quaternion, stamped = (store.types[f"geometry_msgs/msg/{kind}"] for kind in kinds)
    header, moment = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    made = several(toss, World(), 2, 3)
    for each in made:
        writer = BagWriter(tmp_path / each.name, version=9, storage_plugin=StoragePlugin.SQLITE3)
        with writer as bag:
            topic = bag.add_connection("/mocap/block/pose", stamped.__msgtype__, typestore=store)
            for t, x, q in zip(each.track.time, each.track.position, each.track.quat_xyzw, strict=True):
                stamp = moment(sec=int(t) + 5, nanosec=int(1e9 * (t % 1.0)))
                message = stamped(header(stamp, "world"), pose(point(*x), quaternion(*q)))
                bag.write(topic, int(1e9 * (t + 5)), store.serialize_cdr(message, stamped.__msgtype__))
    draft = drafted(tmp_path)
    assert draft.kind == "bodies" and not draft.questions
    got = [each.recording for each in bodies_of(as_yaml(draft), tmp_path / "m.yaml", tmp_path)]
    assert [each.name for each in got] == [each.name for each in made]
    np.testing.assert_allclose(got[0].track.position, made[0].track.position, atol=1e-9)


def test_a_commanded_torque_and_degrees_per_second_say_what_they_are(tmp_path: Path) -> None:
    """The torque was left out, and the log was sure that it had none."""
    time = np.arange(0.0, 6.0, 0.01)
    angle = np.stack([np.sin(time), 0.5 * np.cos(1.3 * time)], axis=1)
    rate = np.stack([np.cos(time), -0.65 * np.sin(1.3 * time)], axis=1)
    names = "time_s,j1_q_deg,j2_q_deg,j1_qd_deg_s,j2_qd_deg_s,j1_tau_cmd_Nm,j2_tau_cmd_Nm"
    save(tmp_path / "run.csv", names, time, np.degrees(angle), np.degrees(rate), 3.0 * angle)
    draft = drafted(tmp_path / "run.csv")
    assert draft.kind == "joints" and not draft.questions
    assert draft.channels["states"]["velocity"]["unit"] == "deg/s"
    assert draft.channels["commanded_effort"]["effort"]["unit"] == "N m"


@pytest.mark.parametrize(
    ("name", "unit"),
    [("torque_mNm", "mN m"), ("torque [N.mm]", "mN m"), ("M_cNm", "N cm"), ("tau_kN_m", "kN m")],
)
def test_a_unit_of_torque_keeps_its_prefix(tmp_path: Path, name: str, unit: str) -> None:
    """`mNm` was read as m beside Nm: sure of N m, a thousand times too much."""
    time = np.arange(0.0, 6.0, 0.01)
    save(tmp_path / "run.csv", f"time_s,q_rad,{name}", time, np.sin(time), 40.0 * np.cos(time))
    draft = draft_any([tmp_path / "run.csv"], None, None, Effort.drive)
    assert draft.channels["commanded_effort"]["effort"]["unit"] == unit
    assert not draft.questions


def test_a_torque_called_measured_is_used_as_stated_beside_a_commanded_one(tmp_path: Path) -> None:
    """Beside a plain `q` the sensor's torque went unused without a reason, whatever --effort said."""
    time = np.arange(0.0, 6.0, 0.01)
    names = "time_s,q_rad,tau_cmd_Nm,tau_meas_Nm"
    save(tmp_path / "run.csv", names, time, np.sin(time), 4.0 * np.cos(time), 3.0 * np.cos(time))
    draft = draft_any([tmp_path / "run.csv"], None, None, Effort.link)
    states, commanded = draft.channels["states"], draft.channels["commanded_effort"]
    assert states["effort"]["formula"] != commanded["effort"]["formula"]
    assert not draft.unused


def test_a_tag_beside_what_nobody_understands_is_no_sure_body(tmp_path: Path) -> None:
    save_tag(tmp_path)
    assert drafted(tmp_path).questions  # a tag alone
    numbers = np.random.default_rng(1).standard_normal((400, 3))
    save(tmp_path / "arm.csv", "time_s,u1,u2,u3", 0.03 * np.arange(400), numbers)
    draft = drafted(tmp_path)
    assert draft.kind != "bodies" or any("arm.csv" in guess.reason for guess in draft.guesses)
    assert draft.questions


def test_angles_of_robot_makers_are_roll_pitch_and_yaw(tmp_path: Path) -> None:
    """KUKA's A, B and C turn about z, y and x; OpenCV's vectors stand beside them in one table."""
    made = record(PoseWorld(seconds=12.0)).seen
    poses = flange(made.time, PoseWorld(seconds=12.0))
    angles = Rotation.from_matrix(poses[:, :3, :3]).as_euler("ZYX", degrees=True)
    vectors = Rotation.from_quat(made.quat_xyzw).as_rotvec()
    names = "nr,X [mm],Y [mm],Z [mm],A [deg],B [deg],C [deg],rvec_x,rvec_y,rvec_z,tvec_x,tvec_y,tvec_z"
    rows = [np.arange(len(angles)), 1e3 * poses[:, :3, 3], angles, vectors, 1e3 * made.position]
    save(tmp_path / "pairs.csv", names, *(row[::9] for row in rows))
    draft = drafted(tmp_path / "pairs.csv")
    assert draft.kind == "poses" and draft.poses["at_rest"]
    assert draft.poses["camera_arm"]["flange"]["rpy"] == ["C__deg", "B__deg", "A__deg"]
    assert draft.poses["camera_arm"]["flange"]["angle_unit"] == "deg"
    assert draft.poses["target_in_camera"]["rotation_vector"] == ["rvec_x", "rvec_y", "rvec_z"]


def test_a_target_seen_beside_joints_closes_the_chain_by_the_description(tmp_path: Path) -> None:
    """No flange is logged; the target alone was a body that falls in an unknown unit."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = "Pose Point Quaternion PoseStamped".split()
    pose, point, quaternion, stamped = (store.types[f"geometry_msgs/msg/{kind}"] for kind in kinds)
    header, moment = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    state = store.types["sensor_msgs/msg/JointState"]
    time = np.arange(0.0, 6.0, 0.1)
    angles = HOME + 0.3 * np.sin(np.outer(time, 0.5 + 0.3 * np.arange(len(JOINTS))))
    flanges, _, _ = RigidArm(ArmDescription("arm", JOINTS, URDF, None, None)).kinematics(angles)
    seen = np.linalg.inv(flanges @ CAMERA) @ TARGET
    quaternions = Rotation.from_matrix(seen[:, :3, :3]).as_quat()
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        joints = bag.add_connection("/joint_states", state.__msgtype__, typestore=store)
        tag = bag.add_connection("/aruco_single/pose", stamped.__msgtype__, typestore=store)
        for t, q, x, turn in zip(time, angles, seen[:, :3, 3], quaternions, strict=True):
            stamp = moment(sec=int(t) + 5, nanosec=int(1e9 * (t % 1.0)))
            message = state(header(stamp, ""), list(JOINTS), q, np.zeros(0), np.zeros(0))
            bag.write(joints, int(1e9 * (t + 5)), store.serialize_cdr(message, state.__msgtype__))
            message = stamped(header(stamp, "camera_optical_frame"), pose(point(*x), quaternion(*turn)))
            bag.write(tag, int(1e9 * (t + 5)), store.serialize_cdr(message, stamped.__msgtype__))
    (tmp_path / "arm.urdf").write_text(URDF)
    draft = draft_any([tmp_path / "bag"], URDF, str(tmp_path / "arm.urdf"))
    assert draft.kind == "poses" and not draft.questions
    (one,) = poses_of(as_yaml(draft), tmp_path / "m.yaml", tmp_path)
    assert one.recording.camera_arm is not None and one.recording.camera_arm.joints == JOINTS
    assert closing_error(one.recording) < 1e-3
    assert drafted(tmp_path / "bag").kind == "joints"  # without the description, and no falling body


def test_the_order_of_frames_in_a_name_is_taken_and_asked_for(tmp_path: Path) -> None:
    """T_tag_cam is mostly the camera in the tag: taken otherwise the camera would ride on the arm."""
    world = PoseWorld(seconds=12.0)
    made = record(world).seen
    seen = np.tile(np.eye(4), (len(made.time), 1, 1))
    seen[:, :3, :3], seen[:, :3, 3] = Rotation.from_quat(made.quat_xyzw).as_matrix(), made.position
    flanges = flange(made.time, world)
    inverse = np.linalg.inv(seen)
    np.savez(tmp_path / "a.npz", T_base_ee=flanges[::9], T_tag_cam=inverse[::9])
    draft = drafted(tmp_path / "a.npz")
    assert draft.poses["target_in_camera"]["inverse"] and "inverse" not in draft.poses["camera_arm"]["flange"]
    assert any("T_tag_cam is taken as inverse" in question for question in draft.questions)
    np.savez(tmp_path / "b.npz", T_ee_base=np.linalg.inv(flanges)[::9], T_cam_tag=seen[::9])
    draft = drafted(tmp_path / "b.npz")
    assert draft.poses["camera_arm"]["flange"]["inverse"] and "inverse" not in draft.poses["target_in_camera"]
