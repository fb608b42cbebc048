"""The chain from camera to target along a recording, and how it moves with each of its links.

    target in camera = (camera arm's flange . camera)^-1 . base . (tool arm's flange . target)

An arm that is absent stands still at the identity. Errors are left twists in the camera's frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from samrl_core.cell.types.arm_description import ArmDescription
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.pose_recording import ArmPoses, PoseRecording, PoseTrack
from samrl_core.diagnosis.residuals.poses import rigid
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm

LINKS = ("camera", "base", "target")  # constant transforms of the chain
KEPT_FLANGES = 6  # of the last shifts: least squares asks for one shift again and again


@dataclass(frozen=True, eq=False)
class Constants:
    """The constant transforms at which residuals are formed, and which of them nobody stated."""

    camera: np.ndarray  # (4, 4) in the camera arm's flange
    base: np.ndarray  # (4, 4) of the tool arm in the camera arm's base
    target: np.ndarray  # (4, 4) in the tool arm's flange
    free: frozenset[str] = frozenset()  # of `LINKS`

    @staticmethod
    def stated(recording: PoseRecording) -> Constants:
        """As the recording states them; identities where it does not."""

        def matrix(pose: Pose | None) -> np.ndarray:
            return np.eye(4) if pose is None else pose.matrix()

        poses = {
            "camera": recording.camera_in_flange,
            "base": recording.base_in_base,
            "target": recording.target_in_flange,
        }
        used = used_links(recording)
        free = frozenset(name for name in used if poses[name] is None)
        made = {name: matrix(poses[name]) if name in used else np.eye(4) for name in LINKS}
        return Constants(**made, free=free)


def used_links(recording: PoseRecording) -> tuple[str, ...]:
    """Constant transforms that the recording's chain has: one before each arm that moves, and one after."""
    if recording.camera_arm is None:
        return ("camera", "target")
    return LINKS if recording.tool_arm is not None else ("camera", "base")


class Arm:
    """Flange of one arm in its base over time, and what its joints do to it."""

    def __init__(self, poses: ArmPoses, timed: bool) -> None:
        """Interpolate the track, or the joints and the URDF's kinematics."""
        self.role, self.joints = poses.role, poses.joints
        self._stamps = poses.stamps
        self._track = None if poses.flange is None else rigid.Interpolated(poses.flange, timed)
        self._flange = poses.flange if timed else None
        self._rigid = None
        if poses.joints and poses.urdf is not None:
            self._rigid = RigidArm(ArmDescription(poses.role, poses.joints, poses.urdf, None, None))
            self._angles = np.asarray(poses.joint_position, dtype=float)
            self._angle_stamps = poses.joint_time

    @cached_property
    def _smooth(self) -> rigid.Interpolated | None:
        """The track without most of its noise, which only shifts of stamps ask for."""
        smooth = None if self._flange is None else rigid.smoothed(self._flange)
        return self._track if smooth is None or smooth is self._flange else rigid.Interpolated(smooth)

    @property
    def has_joints(self) -> bool:
        """Whether its joints are known, so that errors of them can be told."""
        return self._rigid is not None

    @property
    def links(self) -> tuple[str, ...]:
        """Links that its joints move."""
        assert self._rigid is not None
        return self._rigid.links

    def at(self, time: np.ndarray, smooth: bool = False) -> np.ndarray:
        """Flange in base (N, 4, 4) at the arm's own stamps [s]; `smooth` without most of a track's noise."""
        track = self._smooth if smooth else self._track
        if track is not None:
            return track.at(time)
        assert self._rigid is not None
        return self._rigid.placements(self._read(time))[0]

    def kinematics(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Flange (N, 4, 4) and links (N, J, 4, 4) in the base, joints' twists (N, J, 6) in base axes."""
        assert self._rigid is not None
        return self._rigid.kinematics(self._read(time))

    def _read(self, time: np.ndarray) -> np.ndarray:
        """Joint positions (N, J) at the arm's own stamps [s]."""
        return np.stack([np.interp(time, self._angle_stamps, column) for column in self._angles.T], axis=1)


class Chain:
    """The chain of one recording at given constants."""

    def __init__(self, recording: PoseRecording, constants: Constants) -> None:
        """Interpolate the arms; nothing is evaluated yet."""
        self.recording, self.constants = recording, constants
        self.time = recording.seen.time
        arms = (recording.camera_arm, recording.tool_arm)
        self.arms: tuple[Arm | None, Arm | None] = (
            None if arms[0] is None else Arm(arms[0], recording.timed),
            None if arms[1] is None else Arm(arms[1], recording.timed),
        )
        self.seen = rigid.transforms(recording.seen.position, recording.seen.quat_xyzw)
        self._flanges: dict[tuple[int, float, bool], np.ndarray] = {}  # of the last shifts
        self._from_target: tuple[Constants, np.ndarray] | None = None

    def flange(self, side: int, shift: float | np.ndarray = 0.0, smooth: bool = False) -> np.ndarray:
        """Flange of the camera arm (0) or the tool arm (1) at the camera's stamps plus `shift` [s]."""
        arm = self.arms[side]
        if arm is None:
            return np.broadcast_to(np.eye(4), (len(self.time), 4, 4))
        if isinstance(shift, np.ndarray):
            return arm.at(self.time + shift, smooth)
        key = side, shift, smooth
        if key not in self._flanges:
            if len(self._flanges) >= KEPT_FLANGES:
                self._flanges.pop(next(iter(self._flanges)))
            self._flanges[key] = arm.at(self.time + shift, smooth)
        return self._flanges[key]

    def predicted(
        self, shifts: Sequence[float | np.ndarray] = (0.0, 0.0), smooth: bool = False
    ) -> np.ndarray:
        """Target in camera (N, 4, 4), each arm read at the camera's stamps plus its shift [s]."""
        c = self.constants
        camera = rigid.inverse(self.flange(0, shifts[0], smooth) @ c.camera)
        return camera @ c.base @ self.flange(1, shifts[1], smooth) @ c.target

    def predicted_each(self, offsets: np.ndarray) -> np.ndarray:
        """Target in camera (K, N, 4, 4), both arms read at the camera's stamps plus each offset (K,) [s]."""
        c = self.constants
        time = (self.time + offsets[:, None]).reshape(-1)
        camera, tool = (
            np.eye(4) if arm is None else arm.at(time).reshape(len(offsets), -1, 4, 4) for arm in self.arms
        )
        return np.asarray(rigid.inverse(camera @ c.camera) @ c.base @ tool @ c.target)

    def error_twists(self, shifts: Sequence[float] = (0.0, 0.0)) -> Mapping[str, np.ndarray]:
        """Twists (6, N, 6) of the target in the camera per unit right twist of each constant in use."""
        c = self.constants
        camera = rigid.inverse(self.flange(0, shifts[0]) @ c.camera)
        predicted = self.predicted(shifts)
        out = {
            "camera": np.broadcast_to(-np.eye(6), (len(predicted), 6, 6)),
            "base": rigid.adjoint(camera @ c.base),
            "target": rigid.adjoint(predicted),
        }
        return {name: np.moveaxis(out[name], 2, 0) for name in used_links(self.recording)}

    def shift_twist(self, shifts: Sequence[float | np.ndarray]) -> np.ndarray:
        """Twist (N, 6) that reading the arms at shifted stamps makes.

        Of smoothed tracks: between its stamps a spline has less of a track's noise than at them, so a shift
        of the raw one would take noise off the residual, and seem to be there.
        """
        if self._from_target is None or self._from_target[0] is not self.constants:
            self._from_target = self.constants, rigid.inverse(self.predicted(smooth=True))
        return rigid.log(self.predicted(shifts, smooth=True) @ self._from_target[1])

    def rate(self, side: int, step: float) -> np.ndarray:
        """Twist (N, 6) per second by which one arm's reading moves the target in the camera.

        Of smoothed tracks, as a shift: a raw rate holds the noise of the readings on both sides.
        """
        ahead = [0.0, 0.0]
        ahead[side] = step
        behind = [0.0, 0.0]
        behind[side] = -step
        moved = self.predicted(ahead, smooth=True) @ rigid.inverse(self.predicted(behind, smooth=True))
        return rigid.log(moved) / (2.0 * step)

    def joint_twists(self, side: int) -> np.ndarray:
        """Twists (J, N, 6) in the camera per radian by which each joint is further than it reads."""
        _, _, twists = self._kinematics(side)
        return np.einsum("nab,njb->jna", self._from_base(side), twists)

    def link_twists(self, side: int, joint: int) -> np.ndarray:
        """Twists (6, N, 6) in the camera per unit right twist of a link's frame at its joint."""
        _, links, _ = self._kinematics(side)
        return np.moveaxis(self._from_base(side) @ rigid.adjoint(links[:, joint]), 2, 0)

    def _kinematics(self, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        arm = self.arms[side]
        assert arm is not None
        return arm.kinematics(self.time)

    def _from_base(self, side: int) -> np.ndarray:
        """Adjoints (N, 6, 6) from an arm's base to the camera; its own arm moves it the other way."""
        camera = rigid.inverse(self.flange(0) @ self.constants.camera)
        return -rigid.adjoint(camera) if side == 0 else rigid.adjoint(camera @ self.constants.base)


def track_rate(track: PoseTrack) -> float:
    """Typical rate of a track [Hz]; 0 for a single pose."""
    return 1.0 / float(np.median(np.diff(track.time))) if len(track) > 1 else 0.0
