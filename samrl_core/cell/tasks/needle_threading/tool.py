"""The tool of needle threading: Franka Hand with a thread between its fingers, a chain of capsules."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.tasks.hand import (
    GRIP_IN_FLANGE,
    HAND_COLOR,
    HAND_PARTS,
    HAND_TCP_Z,
    hand_lump,
    hand_meshes,
    hand_parts,
)
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Capsule, ChainLink, Rgb, Tool

THREAD_COLOR: Rgb = (0.85, 0.10, 0.10)


def thread_links(
    count: int,
    colors: tuple[Rgb, ...],
    length: float,
    radius: float,
    mass: float,
    stiffness: float,
    damping: float,
    friction: float,
    label: int,
) -> tuple[ChainLink, ...]:
    """So many links from the gripper down, their colours in turn. SI units, each link's own.

    A link is a solid capsule from its pair of joints to the next.
    """
    middle = np.array([0.0, 0.0, 0.5 * length])
    capsule = Capsule(radius, length, Pose(middle, np.array([0.0, 0.0, 0.0, 1.0])))
    inertia = capsule_inertia(radius, length, mass)
    return tuple(
        ChainLink(
            f"thread_{i}", (capsule,), colors[i % len(colors)], label, length, mass, middle, inertia,
            stiffness, damping, friction,
        )
        for i in range(count)
    )  # fmt: skip


def capsule_inertia(radius: float, length: float, mass: float) -> np.ndarray:
    """Inertia (3, 3) [kg m2] of a solid capsule about its centre; `length` is between its ends' centres."""
    cylinder, ball = np.array([length, 4 / 3 * radius]) * mass / (length + 4 / 3 * radius)
    along = cylinder * radius**2 / 2 + ball * radius**2 * 2 / 5
    # A half ball's centre lies 3/8 of its radius from its flat face.
    away = ball * (2 / 5 * radius**2 + length**2 / 4 + 3 / 8 * length * radius)
    across = cylinder * (3 * radius**2 + length**2) / 12 + away
    return np.diag([across, across, along])


def hand_with_thread(chain: tuple[ChainLink, ...], radius: float, friction: float, label: int) -> Tool:
    """Hand and thread; the tip is the gripped end, at the fingertip centre."""
    hand = hand_lump()
    tip = Pose(np.array([0.0, 0.0, HAND_TCP_Z]), np.array([0.0, 0.0, 0.0, 1.0]))
    return Tool(
        "hand_with_thread",
        hand_parts(radius),
        HAND_COLOR,
        label,
        hand.mass,
        hand.center,
        hand.inertia,
        tip,
        friction,
        chain,
        hand=HAND_PARTS,
        grip_in_flange=GRIP_IN_FLANGE,
        meshes=hand_meshes(radius),
    )
