"""What is known of an arm and of the cell: figures with sources, no simulator and no maths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from samrl_core.cell.types.camera import Intrinsics
from samrl_core.cell.types.pose import Pose

ROLES = ("tool_arm", "camera_arm")


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits per joint, each an array (J,)."""

    lower: np.ndarray  # [rad]
    upper: np.ndarray  # [rad]
    velocity: np.ndarray  # [rad/s]
    acceleration: np.ndarray  # [rad/s2]
    jerk: np.ndarray  # [rad/s3]
    effort: np.ndarray  # [N m]
    effort_rate: np.ndarray  # [N m/s] that drives keep by themselves; no command is checked against it


@dataclass(frozen=True, eq=False)
class ImpedanceGains:
    """Nominal controller: effort = clip(K (q_d - q) + D (dq_d - dq) + g(q) + feed-forward)."""

    stiffness: np.ndarray  # (J,) [N m/rad]
    damping: np.ndarray  # (J,) [N m s/rad]
    period_s: float  # [s]


@dataclass(frozen=True, eq=False)
class RobotSpec:
    """An arm. `urdf` has revolute joints only; `flange` is a link of it."""

    name: str
    urdf: Path
    joint_names: tuple[str, ...]
    base_link: str
    flange: str
    limits: JointLimits
    controller: ImpedanceGains
    home: np.ndarray  # (J,) [rad]
    armature: np.ndarray  # (J,) rotor inertia seen at the joint [kg m2]
    # Of links, `package://NAME/path` of a mesh, z up, in the link's frame: for viewers where it is installed.
    meshes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class CellSpec:
    """The two-arm cell as calibrated (nominal)."""

    name: str
    tool_arm: RobotSpec
    camera_arm: RobotSpec
    tool_base_in_world: Pose
    camera_base_in_world: Pose
    camera_in_flange: Pose  # hand-eye: colour optical frame in the camera arm's flange
    intrinsics: Intrinsics  # colour camera; depth is aligned to it
    camera_mass: float  # [kg]
    camera_center_of_mass: np.ndarray  # (3,) in the flange frame [m]
    camera_inertia: np.ndarray  # (3, 3) about the centre of mass [kg m2]

    def arm(self, role: str) -> RobotSpec:
        """The arm in a role, `tool_arm` or `camera_arm`."""
        return {"tool_arm": self.tool_arm, "camera_arm": self.camera_arm}[role]

    def base_in_world(self, role: str) -> Pose:
        """Base of the arm in a role."""
        return {"tool_arm": self.tool_base_in_world, "camera_arm": self.camera_base_in_world}[role]
