"""How far a target turns between two views, against how far the flange does: the same in any chain."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose_recording import PoseRecording
from samrl_core.diagnosis.residuals.poses.chain import Arm

MOST_TURNS = 60  # views that are compared, each with each
LEAST_TURN = 0.02  # [rad] root mean square about a second axis, below which a chain's constants do not show


def turns_apart(recording: PoseRecording) -> float:
    """Median difference [rad] of the turns of target and flange between views; 0 where rows are no pairs.

    With A_i X B_i constant, A_i^-1 A_j and B_i B_j^-1 are conjugate, and so turn by one angle, whoever
    carries the camera (Tsai and Lenz 1989, eq. 10). Poses of which this is not so are no chain, or their
    rotations are read in the wrong way.
    """
    arm = recording.camera_arm or recording.tool_arm
    if arm is None or len(arm.stamps) != len(recording.seen.time):
        return 0.0
    step = -(-len(recording.seen.time) // MOST_TURNS)
    flanges = Arm(arm, timed=False).at(arm.stamps[::step])[:, :3, :3]
    one, other = _turns(recording.seen.quat_xyzw[::step]), _turns(Rotation.from_matrix(flanges).as_quat())
    return float(np.median(np.abs(one - other))) if len(one) else 0.0


def _turns(quat_xyzw: np.ndarray) -> np.ndarray:
    """Angles [rad] (N (N - 1) / 2,) between each two."""
    turned = Rotation.from_quat(quat_xyzw)
    first, second = np.triu_indices(len(quat_xyzw), 1)
    return (turned[first].inv() * turned[second]).magnitude()


def second_turn(recording: PoseRecording) -> float:
    """How far the flange turns about a second axis (root mean square, rad); infinite where it is not known.

    A chain's constants show in turns about two axes alone (Tsai and Lenz 1989): without turns a camera may
    sit anywhere, with turns about one axis anywhere along it.
    """
    arm = recording.camera_arm or recording.tool_arm
    if arm is None or arm.flange is None or len(arm.flange.time) < 2:
        return float("inf")
    turned = Rotation.from_quat(arm.flange.quat_xyzw)
    vectors = (turned.mean().inv() * turned).as_rotvec()
    return float(np.linalg.svd(vectors, compute_uv=False)[1] / np.sqrt(len(vectors)))
