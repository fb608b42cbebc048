"""The pancake, a disc whose faces differ in colour: how it lies and slides; and the lip it is turned over."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.tasks.shapes import DiscColors, box_mesh, disc_mesh
from samrl_core.cell.tasks.task import Slide
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Body, Box, Cylinder, Rgb
from samrl_core.common.errors import InputError

RAW_COLOR: Rgb = (0.95, 0.85, 0.55)  # the face that is up at first
BAKED_COLOR: Rgb = (0.55, 0.28, 0.10)
RIM_COLOR: Rgb = (0.80, 0.60, 0.30)
PAINT = DiscColors(RAW_COLOR, BAKED_COLOR, RIM_COLOR)
LIP_COLOR: Rgb = (0.20, 0.20, 0.22)
ASLANT = math.radians(10.0)  # a shaken pan moves within so much of world's y [rad]
AFTER = (0.006, 0.015)  # when the edge is so far from its start, not yet at any pancake [m]


def require_rounding(rounding: float, thickness: float) -> None:
    """Refuse edges that a pancake of a thickness has no room for [m].

    Raises:
        InputError: the rounding is not between 0 and half the thickness.
    """
    if not 0 < rounding < 0.5 * thickness:
        raise InputError(
            f"pancake_rounding is {rounding} m, must lie between 0 and half the thickness, "
            f"{0.5 * thickness} m"
        )


def require_room(half_range: tuple[float, float], radius: float, room: tuple[float, float]) -> None:
    """Refuse a range in which a pancake would lie in the lip or beyond its ends.

    Args:
        half_range: of its centre, in x and y [m].
        radius: of the pancake [m].
        room: from the range's middle to the lip, and to where lip and estimates end aside [m].

    Raises:
        InputError: it would.
    """
    (along, across), (to_lip, end) = half_range, room
    if (left := to_lip - along - radius) < 0:
        raise InputError(
            f"the farthest pancake would reach {-left} m into the lip; move lip_x or shrink the pancake"
        )
    if (aside := across + radius) > end:
        raise InputError(
            f"half_range in y is {across} m: the pancake would reach {aside} m aside, but "
            f"lip and estimates end at {end} m; shorten it or lengthen the lip"
        )


def pancake_body(
    name: str,
    radius: float,
    thickness: float,
    rounding: float,
    mass: float,
    body_in_world: Pose,
    label: int,
    friction: float,
) -> Body:
    """A movable solid cylinder with rounded edges. Lengths [m], mass [kg]."""
    across = mass * (3 * radius**2 + thickness**2) / 12
    return Body(
        name,
        (Cylinder(radius, thickness, Pose.identity()),),
        disc_mesh(radius, thickness, rounding, PAINT),
        body_in_world,
        label,
        mass,
        friction,
        np.diag([across, across, 0.5 * mass * radius**2]),
        rounding,
    )


def pose_of_numbers(v: np.ndarray) -> Pose:
    """Pose of (5,): the centre [m], and x and y of a rotation vector in the table's plane [rad]."""
    angle = math.hypot(v[3], v[4])
    # sin(angle / 2) / angle, which is 1/2 at 0 (np.sinc has a factor of pi).
    share = 0.5 * float(np.sinc(0.5 * angle / math.pi))
    return Pose(v[:3], np.array([share * v[3], share * v[4], 0.0, math.cos(0.5 * angle)]))


def numbers_of_pose(pose: Pose) -> np.ndarray:
    """The inverse (5,); a spin about the pancake's own axis is left out."""
    axis = pose.rotation[:, 2]
    lever = np.array([-axis[1], axis[0]])  # z cross axis, in the plane
    sine = float(np.linalg.norm(lever))
    direction = lever / sine if sine > 1e-12 else np.array([0.0, 1.0])
    return np.concatenate([pose.position, math.atan2(sine, axis[2]) * direction])


def slide_when_shaken(name: str, way: float, rng: np.random.Generator) -> Slide:
    """A slide of a body by a way [m] to either side: arms stand before and behind, who shakes it beside."""
    side, turn = rng.choice([-1.0, 1.0]), rng.uniform(-ASLANT, ASLANT)
    return Slide(name, side * way * np.array([math.sin(turn), math.cos(turn)]), rng.uniform(*AFTER))


def lip_body(
    name: str, size: tuple[float, float, float], body_in_world: Pose, label: int, friction: float
) -> Body:
    """A fixed bar, edges `size` [m]."""
    half = (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
    return Body(
        name,
        (Box(half, Pose.identity()),),
        box_mesh(size, LIP_COLOR),
        body_in_world,
        label,
        0.0,
        friction,
    )
