"""What stands in the cell, with no simulator in it: bodies of simple parts with colours, and the tool."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from samrl_core.cell.types.pose import Pose

Rgb = tuple[float, float, float]  # linear, 0..1


@dataclass(frozen=True, eq=False)
class Box:
    """A box part of a body."""

    half_extents: tuple[float, float, float]  # [m]
    part_in_body: Pose


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder part of a body, axis along its own z."""

    radius: float  # [m]
    length: float  # [m]
    part_in_body: Pose


@dataclass(frozen=True, eq=False)
class Capsule:
    """A cylinder part with round ends, axis along its own z."""

    radius: float  # [m]
    length: float  # between the centres of the round ends [m]
    part_in_body: Pose


Part = Box | Cylinder | Capsule


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Triangles to look at, in body coordinates; faces wound outwards, no shared normals needed."""

    vertices: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3) int32, counter-clockwise seen from outside
    face_color: np.ndarray  # (F, 3) linear RGB 0..1


@dataclass(frozen=True, eq=False)
class Body:
    """A thing in the cell. Physics sees `parts`; cameras see `mesh`. A movable one has its origin at its
    centre of mass.
    """

    name: str
    parts: tuple[Part, ...]
    mesh: SurfaceMesh
    body_in_world: Pose  # nominal
    label: int  # segmentation label, 0 background
    mass: float  # [kg], 0 for fixed
    friction: float  # Coulomb coefficient [-]
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))  # about the origin [kg m2]
    rounding: float = 0.0  # radius of its parts' edges, within their outlines; 0 where it does not matter [m]


@dataclass(frozen=True, eq=False)
class ChainLink:
    """One link of a chain that hangs from the tool.

    Two revolute joints, about its own x and then its own y, join its origin to the end of the link before;
    the first link hangs at the tool's tip. With all angles 0 the chain runs along the tip's z axis.
    """

    name: str
    parts: tuple[Part, ...]  # poses in the link's frame
    color: Rgb
    label: int  # segmentation label
    length: float  # from this link's joints to the next, along its z [m]
    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) in the link's frame [m]
    inertia: np.ndarray  # (3, 3) about the centre of mass, link axes [kg m2]
    stiffness: float  # of each of its two joints, about the angle at which it is made [N m/rad]
    damping: float  # of each of them [N m s/rad]
    friction: float  # Coulomb coefficient [-]


@dataclass(frozen=True, eq=False)
class Tool:
    """What the tool arm holds, in the flange frame: a rigid part, and a chain that may hang from its tip.

    Mass, centre and inertia are those of the rigid part, the load that the arm is told of.
    """

    name: str
    parts: tuple[Part, ...]  # poses in the tool arm's flange frame
    color: Rgb
    label: int  # segmentation label
    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) in the flange frame [m]
    inertia: np.ndarray  # (3, 3) about the centre of mass, flange axes [kg m2]
    tip_in_flange: Pose  # the tool frame, whose origin an action displaces
    friction: float  # [-]
    chain: tuple[ChainLink, ...] = ()
    hand: int = 0  # so many of the last parts are the gripper's own; a grip leaves them where they are
    grip_in_flange: Pose = field(default_factory=Pose.identity)  # where the gripper holds the rest
    meshes: tuple[tuple[str, Pose], ...] = ()  # `package://NAME/path` of the gripper's, poses in the flange


@dataclass(frozen=True, eq=False)
class Scene:
    """All that a world or a model must build for a task."""

    bodies: tuple[Body, ...]
    tool: Tool
