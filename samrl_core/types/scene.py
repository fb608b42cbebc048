"""What stands in the cell, with no simulator in it: bodies as boxes and cylinders with colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.types.pose import Pose

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


Part = Box | Cylinder


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Triangles to look at, in body coordinates; faces wound outwards, no shared normals needed."""

    vertices: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3) int32, counter-clockwise seen from outside
    face_color: np.ndarray  # (F, 3) linear RGB 0..1


@dataclass(frozen=True, eq=False)
class Body:
    """A thing in the cell. Physics sees `parts`; cameras see `mesh`."""

    name: str
    parts: tuple[Part, ...]
    mesh: SurfaceMesh
    body_in_world: Pose  # nominal
    label: int  # segmentation label, 0 background
    mass: float  # [kg], 0 for fixed
    friction: float  # Coulomb coefficient [-]


@dataclass(frozen=True, eq=False)
class Tool:
    """What the tool arm holds rigidly, in the flange frame."""

    name: str
    parts: tuple[Part, ...]  # poses in the tool arm's flange frame
    color: Rgb
    label: int  # segmentation label
    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) in the flange frame [m]
    inertia: np.ndarray  # (3, 3) about the centre of mass, flange axes [kg m2]
    tip_in_flange: Pose  # the tool frame, whose origin an Action displaces
    friction: float  # [-]


@dataclass(frozen=True, eq=False)
class Scene:
    """All that a world or a model must build for a task."""

    bodies: tuple[Body, ...]
    tool: Tool
