"""Recorded pairs of poses as JSON, for hand-eye and for base-to-base calibration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import numpy as np

from samrl_core.cell.calibration.chain_of_poses import PosePairs
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.common.files import read_whole
from samrl_core.common.validation import Checked

MAX_BYTES = 16 * 2**20
Kind = Literal["hand_eye", "base_to_base"]


class PoseEntry(Checked):
    """A pose in a file."""

    position: list[float]  # [m]
    quat_xyzw: list[float]

    def require_sense(self) -> None:
        """See `Checked`."""
        self.pose()

    def pose(self) -> Pose:
        """As a pose. Raises InputError for wrong lengths or a quaternion that is not of unit length."""
        return Pose(np.array(self.position), np.array(self.quat_xyzw))


class HandEyePair(Checked):
    """One standstill of the camera arm before a board that stands still."""

    flange_in_base: PoseEntry
    board_in_camera: PoseEntry


class BasePair(Checked):
    """One standstill of both arms, with a board on the tool arm's flange."""

    tool_flange_in_base: PoseEntry
    camera_flange_in_base: PoseEntry
    board_in_camera: PoseEntry


class HandEyeFile(Checked):
    """`kind: hand_eye`."""

    kind: Literal["hand_eye"]
    pairs: list[HandEyePair]


class BaseFile(Checked):
    """`kind: base_to_base`."""

    kind: Literal["base_to_base"]
    pairs: list[BasePair]


def read_recorded(path: Path) -> HandEyeFile | BaseFile:
    """A file of pairs.

    Raises:
        InputError: no such file, no JSON, or keys, numbers, poses or a kind that do not fit.
    """
    try:
        data = json.loads(read_whole(path, MAX_BYTES).decode())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON in UTF-8 ({error}); see msgs_docs/guide/real_cell.md") from error
    kind = data.get("kind") if isinstance(data, dict) else None
    if kind == "hand_eye":
        return HandEyeFile.read(data, f"{path}:")
    if kind == "base_to_base":
        return BaseFile.read(data, f"{path}:")
    raise InputError(f"{path}: kind is {kind!r}, must be one of hand_eye, base_to_base")


def hand_eye_pairs(file: HandEyeFile) -> PosePairs:
    """measured = camera in board; the solution's inner pose is the camera in the flange."""
    return PosePairs(
        tuple(pair.flange_in_base.pose() for pair in file.pairs),
        tuple(pair.board_in_camera.pose().inverse() for pair in file.pairs),
    )


def base_pairs(file: BaseFile, camera_in_flange: Pose) -> PosePairs:
    """measured = board in the camera arm's base; the solution's outer pose is the tool arm's base in it."""
    return PosePairs(
        tuple(pair.tool_flange_in_base.pose() for pair in file.pairs),
        tuple(
            pair.camera_flange_in_base.pose() @ camera_in_flange @ pair.board_in_camera.pose()
            for pair in file.pairs
        ),
    )


def change_with_camera(file: BaseFile, camera_in_flange: Pose) -> np.ndarray:
    """(N, 6, 6): how the measured poses of `base_pairs` move with the camera in its flange.

    Rows and columns are position in the parent's axes [m], then rotation in the child's axes [rad].
    """
    changes = []
    for pair in file.pairs:
        flange, board = pair.camera_flange_in_base.pose().rotation, pair.board_in_camera.pose()
        camera = flange @ camera_in_flange.rotation
        x, y, z = board.position
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        change = np.zeros((6, 6))
        change[:3, :3], change[:3, 3:] = flange, -camera @ cross
        change[3:, 3:] = board.rotation.T
        changes.append(change)
    return np.array(changes)
