"""The tool of peg insertion: Franka Hand with a peg clamped between its fingers, as one rigid body."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.types.pose import Pose
from samrl_core.types.scene import Box, Cylinder, Rgb, Tool

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

PEG_MASS = 0.05  # [kg], ASSUMPTION
PEG_IN_FINGERS = 0.020  # length of the peg between the fingers [m], ASSUMPTION
PEG_COLOR: Rgb = (0.10, 0.35, 0.90)


def hand_with_peg(peg_radius: float, peg_length: float, friction: float, label: int) -> Tool:
    """Hand and peg; the tip is `peg_length` [m] below the fingertip centre, on the flange's z axis."""
    hand_in_flange = Pose.from_rpy(np.zeros(3), (0.0, 0.0, HAND_YAW))

    def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> Box:
        half = (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
        return Box(half, hand_in_flange @ Pose(np.array(centre), np.array([0.0, 0.0, 0.0, 1.0])))

    finger_y = peg_radius + 0.5 * FINGER_SIZE[1]
    whole = peg_length + PEG_IN_FINGERS
    peg_centre = np.array([0.0, 0.0, HAND_TCP_Z + peg_length - 0.5 * whole])
    parts = (
        Cylinder(peg_radius, whole, Pose(peg_centre, np.array([0.0, 0.0, 0.0, 1.0]))),
        box(PALM_SIZE, (0.0, 0.0, 0.5 * PALM_SIZE[2])),
        box(FINGER_SIZE, (0.0, finger_y, FINGER_MIDDLE_Z)),
        box(FINGER_SIZE, (0.0, -finger_y, FINGER_MIDDLE_Z)),
    )
    across = PEG_MASS * (3 * peg_radius**2 + whole**2) / 12  # solid cylinder
    peg_inertia = np.diag([across, across, 0.5 * PEG_MASS * peg_radius**2])
    turn = hand_in_flange.rotation
    mass = HAND_MASS + PEG_MASS
    hand_centre = hand_in_flange.apply(HAND_CENTER_OF_MASS)
    centre = (HAND_MASS * hand_centre + PEG_MASS * peg_centre) / mass
    inertia = (
        turn @ HAND_INERTIA @ turn.T
        + _steiner(HAND_MASS, hand_centre - centre)
        + peg_inertia
        + _steiner(PEG_MASS, peg_centre - centre)
    )
    tip = Pose(np.array([0.0, 0.0, HAND_TCP_Z + peg_length]), np.array([0.0, 0.0, 0.0, 1.0]))
    return Tool("hand_with_peg", parts, PEG_COLOR, label, mass, centre, inertia, tip, friction)


def _steiner(mass: float, offset: np.ndarray) -> np.ndarray:
    return mass * (float(offset @ offset) * np.eye(3) - np.outer(offset, offset))
