"""The rigid bodies of an arm as numbers: read from its URDF, altered, and written for an engine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

import numpy as np

from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.robots.urdf import numbers, origin_of, read_urdf
from samrl_core.cell.types.arm_description import NominalTool
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError


@dataclass(frozen=True, eq=False)
class MovingLink:
    """A link and the joint that moves it."""

    name: str
    joint: str
    placement_in_parent: Pose  # of the joint frame at q = 0
    axis: np.ndarray  # (3,) in the joint frame, unit length
    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) in the link frame [m]
    inertia: np.ndarray  # (3, 3) about the centre of mass, link axes [kg m2]
    slides: bool = False  # prismatic: the axis is a direction of travel


@dataclass(frozen=True, eq=False)
class ArmBody:
    """A serial chain on a base that is fixed or stands on mount joints; the tool is part of the last link."""

    links: tuple[MovingLink, ...]  # mount joints first, then the arm's
    flange_in_last: Pose
    mount_joints: int = 0  # how many of the first links belong to the mount

    def inertia_about_base(self, q: np.ndarray) -> np.ndarray:
        """Rotational inertia (3, 3) of the arm about the base's origin, base axes [kg m2]."""
        total = np.zeros((3, 3))
        for link, pose in zip(self.links, self.link_poses(q), strict=True):
            total += pose.rotation @ link.inertia @ pose.rotation.T
            total += steiner(link.mass, pose.apply(link.center_of_mass))
        return total

    def link_poses(self, q: np.ndarray) -> list[Pose]:
        """Pose of each moving link in the base, (n,) positions."""
        poses, at = [], Pose.identity()
        for link, value in zip(self.links, q, strict=True):
            at = at @ link.placement_in_parent @ _joint_motion(link, float(value))
            poses.append(at)
        return poses

    @property
    def mass(self) -> float:
        """Of everything that moves with the arm [kg]."""
        return float(sum(link.mass for link in self.links[self.mount_joints :]))


def _joint_motion(link: MovingLink, value: float) -> Pose:
    if link.slides:
        return Pose(value * link.axis, np.array([0.0, 0.0, 0.0, 1.0]))
    half = 0.5 * value
    return Pose(np.zeros(3), np.append(np.sin(half) * link.axis, np.cos(half)))


def steiner(mass: float, offset: np.ndarray) -> np.ndarray:
    """Inertia (3, 3) that a point mass at `offset` (3,) has about the origin [kg m2]."""
    return mass * (float(offset @ offset) * np.eye(3) - np.outer(offset, offset))


def read_arm_body(spec: RobotSpec) -> ArmBody:
    """The chain of a spec's URDF without tool.

    Raises:
        InputError: a joint of the spec is missing, or the chain does not end at the flange.
    """
    root = read_urdf(spec.urdf)
    inertials = {str(link.get("name")): _inertial(link) for link in root.findall("link")}
    by_parent = {}
    for joint in root.findall("joint"):
        by_parent[_part(joint, "parent").get("link")] = joint
    links: list[MovingLink] = []
    at, fixed = spec.base_link, Pose.identity()
    while at in by_parent:
        joint = by_parent[at]
        at = str(_part(joint, "child").get("link"))
        placement = fixed @ origin_of(joint)
        if joint.get("type") == "fixed":
            fixed = placement
            if links and inertials[at][0] > 0:
                links[-1] = join_mass(links[-1], *inertials[at], placement)
            continue
        axis = joint.find("axis")
        direction = np.array([1.0, 0, 0]) if axis is None else numbers(axis, "xyz", "1 0 0", 3)
        links.append(MovingLink(at, str(joint.get("name")), placement, direction, *inertials[at]))
        fixed = Pose.identity()
    if tuple(link.joint for link in links) != spec.joint_names or at != spec.flange:
        raise InputError(f"{spec.urdf} is no serial chain of {spec.joint_names} that ends at {spec.flange}")
    return ArmBody(tuple(links), fixed)


def _part(element: Element, name: str) -> Element:
    found = element.find(name)
    if found is None:
        raise InputError(f"<{element.tag}> {element.get('name', '')!r} has no <{name}>")
    return found


def _inertial(link: Element) -> tuple[float, np.ndarray, np.ndarray]:
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    mass = float(numbers(_part(inertial, "mass"), "value", "", 1)[0])
    pose = origin_of(inertial)
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (float(numbers(_part(inertial, "inertia"), n, "0", 1)[0]) for n in names)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return mass, pose.position, pose.rotation @ inertia @ pose.rotation.T


def join_mass(
    link: MovingLink, mass: float, center_of_mass: np.ndarray, inertia: np.ndarray, placement_in_link: Pose
) -> MovingLink:
    """The link with a body fixed to it; the body's inertia is in its own frame."""
    other = placement_in_link.apply(center_of_mass)
    turned = placement_in_link.rotation @ inertia @ placement_in_link.rotation.T
    total = link.mass + mass
    centre = (link.mass * link.center_of_mass + mass * other) / total
    joined = link.inertia + steiner(link.mass, link.center_of_mass - centre)
    joined = joined + turned + steiner(mass, other - centre)
    return replace(link, mass=total, center_of_mass=centre, inertia=joined)


def with_tool(body: ArmBody, tool: NominalTool) -> ArmBody:
    """The arm with a tool fixed to its flange."""
    last = join_mass(body.links[-1], tool.mass, tool.center_of_mass, tool.inertia, body.flange_in_last)
    return replace(body, links=(*body.links[:-1], last))


def second_moments(inertia: np.ndarray) -> np.ndarray:
    """Integral of x x' over the mass (3, 3), of an inertia about the same point; positive for real bodies."""
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def scaled_inertia(inertia: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """An inertia whose principal second moments are multiplied by `factors` (3,); real bodies stay real."""
    values, axes = np.linalg.eigh(second_moments(inertia))
    moments = axes @ np.diag(values * factors) @ axes.T
    return np.trace(moments) * np.eye(3) - moments
