"""Recordings of poses: what a camera saw of a target, and where the flanges were."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.errors import InputError

FARTHEST_M = 1000.0  # beyond it, rounding of a fit eats a millimetre; no camera sees so far


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """Poses of a child frame in a parent frame at strictly increasing stamps of one clock."""

    time: np.ndarray  # (N,) [s]
    position: np.ndarray  # (N, 3) [m]
    quat_xyzw: np.ndarray  # (N, 4) unit quaternions

    def __post_init__(self) -> None:
        count = len(self.time)
        shapes = {"position": (count, 3), "quat_xyzw": (count, 4)}
        for name, shape in shapes.items():
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(f"{name} of a pose track has shape {value.shape}, must be finite {shape}")
        if count and float(np.max(np.abs(self.position))) > FARTHEST_M:
            k = int(np.argmax(np.abs(self.position).max(axis=1)))
            raise InputError(
                f"position {k} of a pose track is {np.abs(self.position[k]).max():.3g} m from its frame, "
                f"more than {FARTHEST_M:g} m; check the unit, or give positions in a nearer frame"
            )
        if count > 1 and float(np.min(np.diff(self.time))) <= 0:
            raise InputError("stamps of a pose track must increase; leave out repeated poses")
        length = np.linalg.norm(self.quat_xyzw, axis=1)
        if count and float(np.max(np.abs(length - 1.0))) > 1e-3:
            k = int(np.argmax(np.abs(length - 1.0)))
            raise InputError(f"quaternion {k} of a pose track has length {length[k]:.4f}, must be 1")

    def __len__(self) -> int:
        return len(self.time)

    def between(self, begin: float, end: float) -> PoseTrack:
        """The part with stamps in [begin, end)."""
        keep = (self.time >= begin) & (self.time < end)
        return PoseTrack(self.time[keep], self.position[keep], self.quat_xyzw[keep])


@dataclass(frozen=True, eq=False)
class ArmPoses:
    """One arm of a pose recording: its flange in its base, or its joints with the URDF that gives it."""

    role: str  # tool_arm or camera_arm
    flange: PoseTrack | None = None  # in the arm's base; None: by the joints
    joints: tuple[str, ...] = ()
    joint_time: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (M,) [s]
    joint_position: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))  # (M, J) [rad]
    urdf: str | None = None

    @property
    def stamps(self) -> np.ndarray:
        """Stamps (M,) of whichever gives the flange [s]."""
        return self.flange.time if self.flange is not None else self.joint_time


@dataclass(frozen=True)
class PoseTolerances(StatedTolerances):
    """How far the real system may be from its nominal description and still count as nominal.

    Half widths of what is plausible, unless `stated_as` says that they are standard deviations. Defaults of
    the transforms are those of a calibration that was just made: 0.5 mm and 0.05 degrees.
    """

    camera_position: float = 0.0005  # per axis [m]
    camera_rotation: float = 0.0009  # per axis [rad]
    base_position: float = 0.0005  # of the other base, or of the target in the base, per axis [m]
    base_rotation: float = 0.0009  # per axis [rad]
    target_position: float = 0.0005  # of the target on its flange, per axis [m]
    target_rotation: float = 0.0009  # per axis [rad]
    target_size: float = 0.001  # of the target's printed size, as a fraction
    encoder: float = 0.0001  # zero of each joint [rad]
    stamp: float = 0.001  # of a device's clock against another's [s]
    detection_position: float = 0.0003  # errors of the detected pose that last over views, per axis [m]
    detection_rotation: float = 0.001  # likewise [rad]


@dataclass(frozen=True, eq=False)
class PoseRecording:
    """Poses of a target seen by a camera, with the arms that carry either; nominal transforms as stated.

    The chain is camera <- (camera arm's flange <- its base | world) <- (tool arm's base | world) <- (tool
    arm's flange) <- target. A transform that is None is unknown: it is solved for, and its error is nobody's.
    """

    name: str
    source: str
    sha256: str
    seen: PoseTrack  # target in the camera's optical frame
    camera_arm: ArmPoses | None  # None: the camera stands still
    tool_arm: ArmPoses | None  # None: the target stands still
    camera_in_flange: Pose | None  # in the camera arm's flange; of a still camera: in the tool arm's base
    base_in_base: Pose | None  # tool arm's base in the camera arm's; of a still target: the target in it
    target_in_flange: Pose | None  # in the tool arm's flange; not used with a still target
    camera: str = "camera"
    target: str = "target"
    timed: bool = True  # stamps tell when: false for pairs taken at rest
    tolerances: PoseTolerances = field(default_factory=PoseTolerances)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.seen.time[-1] - self.seen.time[0])

    @property
    def arms(self) -> tuple[ArmPoses, ...]:
        """Arms that move."""
        return tuple(a for a in (self.camera_arm, self.tool_arm) if a is not None)
