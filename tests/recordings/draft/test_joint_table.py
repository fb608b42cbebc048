"""Joints and a board in the rows of one table, as scripts of hand-eye calibration write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.residuals.poses.solve import closing_error
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm
from samrl_ros.log_import.draft.any_draft import draft_any
from samrl_ros.log_import.draft.guess import Draft
from samrl_ros.log_import.draft.writing import as_yaml
from samrl_ros.log_import.pose_importer import poses_of
from tests.diagnosis.poses.pose_worlds import CAMERA, TARGET
from tests.diagnosis.worlds import HOME, JOINTS, URDF

VIEWS = 12


def views() -> tuple[np.ndarray, np.ndarray]:
    """Joints (N, J) [rad], and boards in the camera (N, 4, 4)."""
    angles = HOME + 0.7 * np.random.default_rng(3).uniform(-1.0, 1.0, (VIEWS, len(JOINTS)))
    flanges, _, _ = RigidArm(ArmDescription("arm", JOINTS, URDF, None, None)).kinematics(angles)
    return angles, np.linalg.inv(flanges @ CAMERA) @ TARGET


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    np.savetxt(
        path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments=""
    )
    return path


def opencv(joints: dict[str, np.ndarray], seen: np.ndarray) -> dict[str, np.ndarray]:
    turned = Rotation.from_matrix(seen[:, :3, :3]).as_rotvec()
    vectors = {f"rvec_{axis}": turned[:, k] for k, axis in enumerate("xyz")}
    vectors |= {f"tvec_{axis}_mm": 1e3 * seen[:, k, 3] for k, axis in enumerate("xyz")}
    return {"sample": np.arange(VIEWS), **joints, **vectors}


def quaternions(joints: dict[str, np.ndarray], seen: np.ndarray) -> dict[str, np.ndarray]:
    turned = Rotation.from_matrix(seen[:, :3, :3]).as_quat()
    return (
        joints
        | {f"t{axis}": seen[:, k, 3] for k, axis in enumerate("xyz")}
        | {f"q{axis}": turned[:, k] for k, axis in enumerate("xyzw")}
    )


def described(path: Path) -> Draft:
    (path.parent / "arm.urdf").write_text(URDF)
    return draft_any([path], URDF, str(path.parent / "arm.urdf"))


def closes(draft: Draft, folder: Path) -> float:
    draft.guesses.clear()  # questions keep a mapping from use
    (one,) = poses_of(as_yaml(draft), folder / "m.yaml", folder)
    assert not one.recording.timed
    return closing_error(one.recording)


def test_joints_by_name_in_degrees_and_a_board_of_opencv_ask_nothing(tmp_path: Path) -> None:
    """Refused before: 12 rows, of which joints need 50."""
    angles, seen = views()
    named = {f"{joint}_deg": np.degrees(angles[:, k]) for k, joint in enumerate(JOINTS)}
    draft = described(write(tmp_path / "samples.csv", opencv(named, seen)))
    assert draft.kind == "poses" and not draft.questions
    assert draft.poses["camera_arm"]["joints"]["angle_unit"] == "deg"
    assert draft.poses["at_rest"] and draft.poses["target_in_camera"]["unit"] == "mm"
    assert closes(draft, tmp_path) < 1e-4


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_numbered_joints_are_in_the_arms_order_and_their_unit_closes_the_chain(
    tmp_path: Path, unit: str
) -> None:
    """Of a board that no name places in the camera that is asked."""
    angles, seen = views()
    angles = angles if unit == "rad" else np.degrees(angles)
    numbered = {f"q{k + 1}": angles[:, k] for k in range(len(JOINTS))}
    draft = described(write(tmp_path / "log.csv", quaternions(numbered, seen)))
    (question,) = draft.questions
    assert "is it the target in the camera?" in question
    joints = draft.poses["camera_arm"]["joints"]
    assert joints["names"] == list(JOINTS) and joints["angle_unit"] == unit
    assert closes(draft, tmp_path) < 1e-4


def test_a_board_that_the_joints_do_not_move_is_asked_for(tmp_path: Path) -> None:
    angles, seen = views()
    numbered = {f"q{k + 1}_rad": angles[::-1, k] for k in range(len(JOINTS))}
    draft = described(write(tmp_path / "log.csv", quaternions(numbered, seen)))
    assert any("no description closes the chain" in question for question in draft.questions)


def test_the_description_that_lies_with_the_log_is_taken(tmp_path: Path) -> None:
    angles, seen = views()
    numbered = {f"joint_{k}": angles[:, k] for k in range(len(JOINTS))}
    path = write(tmp_path / "samples.csv", opencv(numbered, seen))
    with pytest.raises(InputError, match="look like joints: give the arm's description by --urdf"):
        draft_any([path], None, None)
    (tmp_path / "arm.urdf").write_text(URDF)
    draft = draft_any([tmp_path], None, None)
    assert draft.kind == "poses" and draft.poses["camera_arm"]["urdf"] == str(
        (tmp_path / "arm.urdf").resolve()
    )
    assert closes(draft, tmp_path) < 1e-4


def test_arrays_of_joints_beside_a_matrix_are_read(tmp_path: Path) -> None:
    angles, seen = views()
    np.savez(tmp_path / "views.npz", joints=angles, T_cam_board=seen)
    draft = described(tmp_path / "views.npz")
    assert draft.poses["camera_arm"]["joints"]["names"] == list(JOINTS)
    assert closes(draft, tmp_path) < 1e-4


def test_torques_beside_a_board_are_joints_of_a_machine(tmp_path: Path) -> None:
    angles, seen = views()
    columns = opencv({f"q{k}": angles[:, k] for k in range(3)}, seen) | {
        f"tau{k}": angles[:, k] for k in range(3)
    }
    with pytest.raises(InputError, match="joints need 50"):
        described(write(tmp_path / "log.csv", columns))


def test_an_arms_own_pose_beside_its_joints_is_no_target(tmp_path: Path) -> None:
    """It closes a chain, too: of a camera that stands where the base is."""
    angles, _ = views()
    flanges, _, _ = RigidArm(ArmDescription("arm", JOINTS, URDF, None, None)).kinematics(angles)
    numbered = {f"q{k + 1}_rad": angles[:, k] for k in range(len(JOINTS))}
    with pytest.raises(InputError, match="joints need 50"):
        described(write(tmp_path / "log.csv", quaternions(numbered, flanges @ CAMERA)))
