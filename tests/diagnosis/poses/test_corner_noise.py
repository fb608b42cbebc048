"""Poses of a square tag by its four corners: their noise depends on how the tag is seen, and is no gap."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import Pose, look_at
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.poses.poses import split_poses
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.poses.chain import Constants
from samrl_core.diagnosis.residuals.poses.corner_noise import corner_noise, find_square
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial
from tests.diagnosis.poses.pose_worlds import (
    CAMERA,
    NONE,
    SMALL,
    TARGET,
    background,
    matrix,
    track,
)

FOCAL_PX, CORNER_PX, HALF_SIDE_M = 615.0, 0.2, 0.04
INTRINSICS = np.array([[FOCAL_PX, 0.0, 320.0], [0.0, FOCAL_PX, 240.0], [0.0, 0.0, 1.0]])
SQUARE = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]], dtype=float)


def detected(poses: np.ndarray, corners: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Poses (N, 4, 4) that OpenCV's solvePnP finds from noisy corners (4, 3) of poses (N, 4, 4)."""
    out = []
    for pose in poses:
        turn, place = Rotation.from_matrix(pose[:3, :3]).as_rotvec(), pose[:3, 3]
        pixels, _ = cv2.projectPoints(corners, turn, place, INTRINSICS, None)
        pixels = pixels + CORNER_PX * rng.standard_normal(pixels.shape)
        _, turn, place = cv2.solvePnP(corners, pixels, INTRINSICS, None, turn, place.copy(), True)
        out.append(matrix(tuple(place.ravel()), tuple(turn.ravel())))
    return np.array(out)


def tag_seen(seed: int, error: np.ndarray = NONE, seconds: float = 45.0) -> PoseRecording:
    """A tag before a camera that goes around it, from its front to far aside and from near to far."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1 / 15)
    phase, speed = rng.uniform(0, 6.28, (6, 2)), rng.uniform(0.3, 1.4, (6, 2))
    x, y, z, aim_x, aim_y, roll = np.sin(time[:, None, None] * speed + phase).mean(axis=2).T
    eye = TARGET[:3, 3] + np.stack([0.35 * x, 0.35 * y, 0.33 + 0.15 * z], axis=1)
    aim = TARGET[:3, 3] + 0.1 * np.stack([aim_x, aim_y, 0.0 * x], axis=1)
    looking = [look_at(e, a, r).matrix() for e, a, r in zip(eye, aim, 0.9 * roll, strict=True)]
    arm = np.array(looking) @ np.linalg.inv(CAMERA)
    poses = np.linalg.inv(arm @ CAMERA @ background(rng) @ error) @ TARGET @ background(rng)
    seen = detected(poses, HALF_SIDE_M * SQUARE, rng)
    return PoseRecording(
        "tag", "made by a test", f"{seed:064x}", track(time, seen),
        ArmPoses("camera_arm", track(time, arm)), None,
        Pose.from_matrix(CAMERA), Pose.from_matrix(TARGET), None,
    )  # fmt: skip


@pytest.mark.parametrize("turn", [(np.pi, 0.0, 0.0), (2.3, 0.3, 0.2)])
def test_the_noise_of_corners_is_what_solvepnp_makes_of_them(turn: tuple[float, ...]) -> None:
    """From the front a tilt is worth a tenth of what it is from aside."""
    pose = matrix((0.1, -0.05, 0.3), turn)
    rng = np.random.default_rng(4)
    found = detected(np.broadcast_to(pose, (90, 4, 4)), HALF_SIDE_M * SQUARE, rng)
    turned = Rotation.from_matrix(found[:, :3, :3] @ pose[:3, :3].T).as_rotvec()
    scatter = np.concatenate([found[:, :3, 3] - pose[:3, 3], turned], axis=1).std(axis=0)
    expected = corner_noise(pose[None], HALF_SIDE_M, 0.0)[0] * CORNER_PX / FOCAL_PX
    assert scatter == pytest.approx(expected, rel=0.3)


def test_the_noise_of_a_tag_is_found_by_how_it_was_seen() -> None:
    recording = tag_seen(1, seconds=18.0)
    trial = PoseTrial(recording, Constants.stated(recording))
    side, begin = trial.noise.square
    assert side == pytest.approx(HALF_SIDE_M, rel=0.5)
    assert begin == 0.0
    assert trial.noise.level == pytest.approx(np.full(6, CORNER_PX / FOCAL_PX), rel=0.5)
    # As noise that grows with the distance alone it left 73.
    likelihood = Likelihood([trial])
    assert likelihood.deficit(likelihood.y, 2.0) < 15.0


def test_even_noise_has_no_corners() -> None:
    rng = np.random.default_rng(2)
    views = np.array(
        [matrix((0.0, 0.0, d), (np.pi - a, 0.0, 0.0)) for d, a in rng.uniform(0.3, 0.9, (300, 2))]
    )
    assert find_square(rng.standard_normal((300, 6)), views, np.ones((300, 6))) == (0.0, 0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_tag_seen_from_all_sides_is_no_gap(seed: int) -> None:
    """Views from the front, whose tilt hardly shows, were log evidence of something unknown."""
    fit, held_out = split_poses(tag_seen(seed))
    assert diagnose([fit], [held_out], DiagnosisSettings())[0].verdict == "no_gap"


@pytest.mark.thorough
def test_a_mount_that_is_off_shows_beside_the_noise_of_corners() -> None:
    fit, held_out = split_poses(tag_seen(1, SMALL))
    found = diagnose([fit], [held_out], DiagnosisSettings())[0]
    assert [each.family for each in found.effects] == ["hand_eye"]
