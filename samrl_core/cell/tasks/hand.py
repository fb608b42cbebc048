"""The Franka Hand as part of a tool, and how the masses of a tool's parts add up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Rgb

# The hand sits on the flange turned by -45 deg about z (franka_description, panda_arm_hand.urdf.xacro).
HAND_YAW = -math.pi / 4  # [rad]
# Fingertip centre from the flange (franka_description, hand_tcp joint).
HAND_TCP_Z = 0.1034  # [m]
# Hand with fingers: load data to be set in Desk (Franka Hand manual, "Mechanical data of Hand").
HAND_MASS = 0.73  # [kg]
HAND_CENTER_OF_MASS = np.array([-0.01, 0.0, 0.03])  # hand frame [m]
HAND_INERTIA = np.diag([0.001, 0.0025, 0.0017])  # about the centre of mass, hand axes [kg m2]
# Outer boxes. ASSUMPTION: rounded from the collision shapes of franka_description.
PALM_SIZE = (0.060, 0.200, 0.066)  # [m]
FINGER_SIZE = (0.020, 0.015, 0.054)  # [m]
FINGER_MIDDLE_Z = 0.085  # [m]
FINGER_MESH_Z = 0.0584  # origin of a finger's mesh (franka_description, finger_joint1) [m]
HAND_COLOR: Rgb = (0.75, 0.75, 0.75)
HAND_PARTS = 3  # palm and two fingers
TOOL_LABEL = 2  # of the hand with what it holds, in masks
GRIP_IN_FLANGE = Pose(np.array([0.0, 0.0, HAND_TCP_Z]), np.array([0.0, 0.0, 0.0, 1.0]))

_UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Lump:
    """A rigid part's mass, in the flange frame."""

    mass: float  # [kg]
    center: np.ndarray  # (3,) [m]
    inertia: np.ndarray  # (3, 3) about the centre, flange axes [kg m2]


def hand_parts(opening: float) -> tuple[Box, ...]:
    """Palm and two fingers, each finger's pad `opening` [m] from the middle; in the flange frame."""
    hand_in_flange = Pose.from_rpy(np.zeros(3), (0.0, 0.0, HAND_YAW))

    def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> Box:
        half = (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
        return Box(half, hand_in_flange @ Pose(np.array(centre), _UNTURNED))

    finger_y = opening + 0.5 * FINGER_SIZE[1]
    return (
        box(PALM_SIZE, (0.0, 0.0, 0.5 * PALM_SIZE[2])),
        box(FINGER_SIZE, (0.0, finger_y, FINGER_MIDDLE_Z)),
        box(FINGER_SIZE, (0.0, -finger_y, FINGER_MIDDLE_Z)),
    )


def hand_meshes(opening: float) -> tuple[tuple[str, Pose], ...]:
    """What palm and fingers look like, as PyBullet's wheel carries them (Apache-2.0); in the flange frame."""
    hand_in_flange = Pose.from_rpy(np.zeros(3), (0.0, 0.0, HAND_YAW))
    folder = "package://franka_panda/meshes/visual/"
    fingers = (
        Pose.from_rpy(np.array([0.0, side * opening, FINGER_MESH_Z]), (0.0, 0.0, yaw))
        for side, yaw in ((1.0, 0.0), (-1.0, math.pi))
    )
    return (
        (folder + "hand.obj", hand_in_flange),
        *((folder + "finger.obj", hand_in_flange @ finger) for finger in fingers),
    )


def hand_lump() -> Lump:
    """Mass of the hand with its fingers."""
    hand_in_flange = Pose.from_rpy(np.zeros(3), (0.0, 0.0, HAND_YAW))
    turn = hand_in_flange.rotation
    return Lump(HAND_MASS, hand_in_flange.apply(HAND_CENTER_OF_MASS), turn @ HAND_INERTIA @ turn.T)


def joined(lumps: Sequence[Lump]) -> Lump:
    """All of them as one rigid body (parallel-axis theorem)."""
    mass = sum(lump.mass for lump in lumps)
    center = np.sum([lump.mass * lump.center for lump in lumps], axis=0) / mass
    inertia = np.sum([lump.inertia + _steiner(lump.mass, lump.center - center) for lump in lumps], axis=0)
    return Lump(mass, center, inertia)


def _steiner(mass: float, offset: np.ndarray) -> np.ndarray:
    return mass * (float(offset @ offset) * np.eye(3) - np.outer(offset, offset))
