"""The tool of spatula flipping: Franka Hand with a tilted blade on a slanting handle, one rigid body."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.tasks.hand import (
    GRIP_IN_FLANGE,
    HAND_PARTS,
    HAND_TCP_Z,
    Lump,
    hand_lump,
    hand_meshes,
    hand_parts,
    joined,
)
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Box, Cylinder, Rgb, Tool

BLADE_MASS = 0.05  # [kg], ASSUMPTION
HANDLE_MASS = 0.05  # [kg], ASSUMPTION
HANDLE_RADIUS = 0.006  # [m], ASSUMPTION
HANDLE_ABOVE_TCP = 0.020  # upper end of the handle above the fingertip centre [m], ASSUMPTION
BLADE_COLOR: Rgb = (0.15, 0.15, 0.18)


def hand_with_spatula(
    blade_size: tuple[float, float, float],
    tilt: float,
    edge_ahead: float,
    edge_below: float,
    friction: float,
    label: int,
) -> Tool:
    """Hand and spatula; the tip is the middle of the blade's leading edge.

    Args:
        blade_size: length, width and thickness [m].
        tilt: of the blade against the table when the hand points straight down [rad].
        edge_ahead: of the flange's axis, along its x [m].
        edge_below: the fingertip centre, along the flange's z [m].
        friction: Coulomb coefficient [-].
        label: segmentation label.
    """
    length, width, thickness = blade_size
    edge = np.array([edge_ahead, 0.0, HAND_TCP_Z + edge_below])
    # Along the blade, from the leading edge back and (z points down) up.
    back = np.array([-math.cos(tilt), 0.0, -math.sin(tilt)])
    blade_turn = np.column_stack([-back, [0.0, 1.0, 0.0], np.cross(-back, [0.0, 1.0, 0.0])])
    blade_in_flange = Pose.from_rotation(edge + 0.5 * length * back, blade_turn)
    blade = Box((0.5 * length, 0.5 * width, 0.5 * thickness), blade_in_flange)

    rear, top = edge + length * back, np.array([0.0, 0.0, HAND_TCP_Z - HANDLE_ABOVE_TCP])
    along = (top - rear) / np.linalg.norm(top - rear)
    handle_length = float(np.linalg.norm(top - rear))
    handle_turn = np.column_stack([np.cross([0.0, 1.0, 0.0], along), [0.0, 1.0, 0.0], along])
    handle_in_flange = Pose.from_rotation(0.5 * (rear + top), handle_turn)
    handle = Cylinder(HANDLE_RADIUS, handle_length, handle_in_flange)

    sides = np.array([length, width, thickness]) ** 2
    blade_inertia = BLADE_MASS / 12 * np.diag(sides.sum() - sides)  # solid box
    across = HANDLE_MASS * (3 * HANDLE_RADIUS**2 + handle_length**2) / 12  # solid cylinder
    handle_inertia = np.diag([across, across, 0.5 * HANDLE_MASS * HANDLE_RADIUS**2])
    load = joined(
        (
            hand_lump(),
            Lump(BLADE_MASS, blade_in_flange.position, blade_turn @ blade_inertia @ blade_turn.T),
            Lump(HANDLE_MASS, handle_in_flange.position, handle_turn @ handle_inertia @ handle_turn.T),
        )
    )
    return Tool(
        "hand_with_spatula",
        (blade, handle, *hand_parts(HANDLE_RADIUS)),
        BLADE_COLOR,
        label,
        load.mass,
        load.center,
        load.inertia,
        Pose(edge, np.array([0.0, 0.0, 0.0, 1.0])),
        friction,
        hand=HAND_PARTS,
        grip_in_flange=GRIP_IN_FLANGE,
        meshes=hand_meshes(HANDLE_RADIUS),
    )
