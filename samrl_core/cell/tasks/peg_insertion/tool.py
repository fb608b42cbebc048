"""The tool of peg insertion: Franka Hand with a peg clamped between its fingers, as one rigid body."""

from __future__ import annotations

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
from samrl_core.cell.types.scene import Cylinder, Rgb, Tool

PEG_MASS = 0.05  # [kg], ASSUMPTION
PEG_IN_FINGERS = 0.020  # length of the peg between the fingers [m], ASSUMPTION
PEG_COLOR: Rgb = (0.10, 0.35, 0.90)


def hand_with_peg(peg_radius: float, peg_length: float, friction: float, label: int) -> Tool:
    """Hand and peg; the tip is `peg_length` [m] below the fingertip centre, on the flange's z axis."""
    whole = peg_length + PEG_IN_FINGERS
    peg_centre = np.array([0.0, 0.0, HAND_TCP_Z + peg_length - 0.5 * whole])
    peg = Cylinder(peg_radius, whole, Pose(peg_centre, np.array([0.0, 0.0, 0.0, 1.0])))
    across = PEG_MASS * (3 * peg_radius**2 + whole**2) / 12  # solid cylinder
    peg_inertia = np.diag([across, across, 0.5 * PEG_MASS * peg_radius**2])
    all_in_all = joined((hand_lump(), Lump(PEG_MASS, peg_centre, peg_inertia)))
    tip = Pose(np.array([0.0, 0.0, HAND_TCP_Z + peg_length]), np.array([0.0, 0.0, 0.0, 1.0]))
    return Tool(
        "hand_with_peg",
        (peg, *hand_parts(peg_radius)),
        PEG_COLOR,
        label,
        all_in_all.mass,
        all_in_all.center,
        all_in_all.inertia,
        tip,
        friction,
        hand=HAND_PARTS,
        grip_in_flange=GRIP_IN_FLANGE,
        meshes=hand_meshes(peg_radius),
    )
