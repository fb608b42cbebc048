"""A mapping file of poses: which columns are the target in the camera, and where the flanges were."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import model_validator
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.common.validation import Checked, fault
from samrl_ros.log_import.specs import LoggedSpec, Pair

Formula = Any  # text or number; `evaluate` refuses the rest with the key path
ROTATIONS = ("quaternion", "rotation_vector", "rpy", "rotation_matrix", "matrix")
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLES = {"rad": 1.0, "deg": float(np.pi / 180)}


class TrackSpec(Checked):
    """A pose over time: position and one kind of rotation, or one matrix of both."""

    source: str | None = None  # None: the only one
    position: list[Formula] | str | None = None  # 3 formulas, or one that gives a list
    unit: Literal["m", "cm", "mm"] = "m"
    quaternion: list[Formula] | str | None = None
    order: Literal["xyzw", "wxyz"] = "xyzw"
    rotation_vector: list[Formula] | str | None = None
    rpy: list[Formula] | str | None = None  # about the fixed x, y, z axes, as in a URDF
    angle_unit: Literal["rad", "deg"] = "rad"
    rotation_matrix: list[Formula] | str | None = None  # 9 numbers, row by row
    matrix: list[Formula] | str | None = None  # 12 or 16 numbers, row by row
    inverse: bool = False  # the log gives the parent in the child

    @model_validator(mode="after")
    def _one_rotation(self) -> TrackSpec:
        given = [name for name in ROTATIONS if getattr(self, name) is not None]
        if len(given) != 1 or (self.matrix is None) == (self.position is None):
            raise fault(f" must have position and one of {', '.join(ROTATIONS[:-1])}, or matrix alone")
        return self

    @property
    def quantities(self) -> dict[str, FormulaList]:
        """Formulas by key, as `read_source` looks for them."""
        found = {key: getattr(self, key) for key in ("position", *ROTATIONS)}
        return {key: FormulaList(value) for key, value in found.items() if value is not None}


class JointsSpec(Checked):
    """Joint positions of an arm over time."""

    source: str | None = None
    names: list[str]
    position: list[Formula] | str
    angle_unit: Literal["rad", "deg"] = "rad"

    @property
    def quantities(self) -> dict[str, FormulaList]:
        """As of a track."""
        return {"position": FormulaList(self.position)}


class FormulaList:
    """One formula that gives a list, or one per component."""

    def __init__(self, value: list[Formula] | str) -> None:
        """As it stands in the file."""
        self.formulas: list[Any] = value if isinstance(value, list) else [value]
        self.listed = isinstance(value, list)


class ArmSpec(Checked):
    """One arm that moves: its flange, or its joints and a URDF; with both, joints say what they could be."""

    flange: TrackSpec | None = None
    joints: JointsSpec | None = None
    urdf: str | None = None

    @model_validator(mode="after")
    def _something(self) -> ArmSpec:
        if self.flange is None and (self.joints is None or self.urdf is None):
            raise fault(" needs flange, or joints with urdf")
        return self


class TransformSpec(Checked):
    """A constant transform as numbers."""

    position: list[float] | None = None
    unit: Literal["m", "cm", "mm"] = "m"
    quaternion: list[float] | None = None
    order: Literal["xyzw", "wxyz"] = "xyzw"
    rotation_vector: list[float] | None = None
    rpy: list[float] | None = None
    angle_unit: Literal["rad", "deg"] = "rad"
    matrix: list[list[float]] | None = None

    def pose(self, where: str) -> Pose:
        """The transform. Raises `InputError` naming the key."""
        if self.matrix is not None:
            made = np.asarray(self.matrix, dtype=float)
            if made.shape not in ((3, 4), (4, 4)):
                raise InputError(f"{where}.matrix has shape {made.shape}, must be 3 or 4 rows of 4 numbers")
            try:
                return Pose.from_matrix(made)
            except InputError as error:
                raise InputError(f"{where}.matrix: {error}") from error
        rotations = {k: getattr(self, k) for k in ROTATIONS[:3] if getattr(self, k) is not None}
        if self.position is None or len(self.position) != 3 or len(rotations) != 1:
            raise InputError(
                f"{where} needs position (3 numbers) and one of {', '.join(ROTATIONS[:3])}, or matrix"
            )
        ((kind, numbers),) = rotations.items()
        rotation = rotations_of(kind, np.array([numbers]), self.order, self.angle_unit, where)
        return Pose(LENGTHS[self.unit] * np.asarray(self.position), rotation.as_quat()[0])


class PosesSpec(Checked):
    """Which poses are recorded, and which transforms are stated."""

    camera: str = "camera"
    target: str = "target"
    target_in_camera: TrackSpec
    camera_arm: ArmSpec | None = None  # that carries the camera; none: the camera stands still
    tool_arm: ArmSpec | None = None  # that carries the target; none: the target stands still
    camera_in_flange: TransformSpec | None = None
    camera_in_base: TransformSpec | None = None  # of a still camera
    base_in_base: TransformSpec | None = None  # the tool arm's base in the camera arm's
    target_in_base: TransformSpec | None = None  # of a still target
    target_in_flange: TransformSpec | None = None
    at_rest: bool = False  # taken in pairs while nothing moved

    @model_validator(mode="after")
    def _arms_and_transforms_agree(self) -> PosesSpec:
        if self.camera_arm is None and self.tool_arm is None:
            raise fault(" needs camera_arm or tool_arm: one of camera and target must be moved by an arm")
        of_no_use = {
            "camera_in_flange": self.camera_arm is None,
            "camera_in_base": self.camera_arm is not None,
            "base_in_base": self.camera_arm is None or self.tool_arm is None,
            "target_in_base": self.tool_arm is not None,
            "target_in_flange": self.tool_arm is None,
        }
        for key, useless in of_no_use.items():
            if useless and getattr(self, key) is not None:
                used = [k for k, no in of_no_use.items() if not no]
                raise fault(f" is no part of this chain; with these arms it has {', '.join(used)}", key)
        return self


class PoseRecordingSpec(LoggedSpec):
    """Everything about one recording of poses, general keys and its own merged."""

    role: Literal["fit", "held_out"] = "fit"
    poses: PosesSpec
    time_range: Pair | None = None

    def readers(self) -> dict[str, TrackSpec | JointsSpec]:
        """Its tracks and joints."""
        found: dict[str, TrackSpec | JointsSpec] = {"poses.target_in_camera": self.poses.target_in_camera}
        for role in ("camera_arm", "tool_arm"):
            arm: ArmSpec | None = getattr(self.poses, role)
            if arm is not None and arm.flange is not None:
                found[f"poses.{role}.flange"] = arm.flange
            if arm is not None and arm.joints is not None:
                found[f"poses.{role}.joints"] = arm.joints
        return found


def rotations_of(kind: str, numbers: np.ndarray, order: str, angle_unit: str, where: str) -> Rotation:
    """Rotations of numbers (N, 3 or 4). Raises `InputError` naming what is no rotation."""
    width = {"quaternion": 4, "rotation_matrix": 9}.get(kind, 3)
    if numbers.shape[1] != width:
        raise InputError(f"{where}.{kind} has {numbers.shape[1]} numbers per sample, must be {width}")
    if kind == "rotation_vector":
        return Rotation.from_rotvec(ANGLES[angle_unit] * numbers)
    if kind == "rpy":
        return Rotation.from_euler("xyz", ANGLES[angle_unit] * numbers)
    if kind == "rotation_matrix":
        return rotations_of_matrices(numbers.reshape(-1, 3, 3), f"{where}.rotation_matrix")
    length = np.linalg.norm(numbers, axis=1)
    if float(np.max(np.abs(length - 1.0))) > 0.01:
        k = int(np.argmax(np.abs(length - 1.0)))
        raise InputError(f"{where}.quaternion: sample {k} has length {length[k]:.4f}, must be 1")
    return Rotation.from_quat(numbers if order == "xyzw" else numbers[:, [1, 2, 3, 0]])


def rotations_of_matrices(rows: np.ndarray, where: str) -> Rotation:
    """Rotations of matrices (N, 3, 3). Raises `InputError` where they are none."""
    apart = np.max(np.abs(rows @ np.swapaxes(rows, 1, 2) - np.eye(3)), axis=(1, 2))
    if float(np.max(apart)) > 1e-2 or float(np.min(np.linalg.det(rows))) < 0.0:
        k = int(np.argmax(apart)) if float(np.max(apart)) > 1e-2 else int(np.argmin(np.linalg.det(rows)))
        raise InputError(f"{where}: sample {k} is no rotation; numbers must stand row by row")
    return Rotation.from_matrix(rows)
