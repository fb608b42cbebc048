"""A mechanism's links as numbers, and as the URDF that its user has."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Link:
    """A body on its joint; its centre of mass lies on one line through the joint."""

    name: str
    joint: str
    kind: str  # revolute or prismatic
    axis: Triple  # in the joint's frame, which is parallel to its parent's at rest
    origin: Triple  # of the joint in the parent's frame [m]
    mass: float  # [kg]
    along: Triple  # direction of the centre of mass
    reach: float  # of the centre of mass along it [m]
    inertia: Triple  # principal moments about the centre of mass, frame's axes [kg m2]
    friction: float = 0.0  # dry, as its description states it [N m or N]
    damping: float = 0.0  # likewise [N m s/rad or N s/m]


def with_point(link: Link, mass: float, at: float) -> Link:
    """The link with a point mass [kg] on its line at a distance [m]."""
    total = link.mass + mass
    reach = (link.mass * link.reach + mass * at) / total
    more = link.mass * (link.reach - reach) ** 2 + mass * (at - reach) ** 2
    across = 1.0 - np.abs(np.array(link.along))
    return _changed(link, total, reach, np.array(link.inertia) + more * across)


def scaled(link: Link, mass: float, reach: float, inertia: float) -> Link:
    """The link with its mass multiplied, its centre shifted along its line [m], its moments multiplied."""
    return _changed(link, link.mass * mass, link.reach + reach, np.array(link.inertia) * inertia)


def _changed(link: Link, mass: float, reach: float, inertia: np.ndarray) -> Link:
    xx, yy, zz = (float(v) for v in inertia)
    return replace(link, mass=mass, reach=reach, inertia=(xx, yy, zz))


def urdf(name: str, links: tuple[Link, ...], effort: list[float], velocity: list[float]) -> str:
    """URDF without shapes, as a user might have written it by hand."""
    parts = [f'<?xml version="1.0"?>\n<robot name="{name}">\n  <link name="base"/>']
    parent = "base"
    for link, most, fastest in zip(links, effort, velocity, strict=True):
        centre = _text([link.reach * v for v in link.along])
        xx, yy, zz = link.inertia
        reach = "3.2" if link.kind == "revolute" else "1.0"
        parts.append(
            f'  <link name="{link.name}">\n    <inertial>\n      <origin xyz="{centre}"/>\n'
            f'      <mass value="{link.mass:.9g}"/>\n'
            f'      <inertia ixx="{xx:.9g}" ixy="0" ixz="0" iyy="{yy:.9g}" iyz="0" izz="{zz:.9g}"/>\n'
            f'    </inertial>\n  </link>\n  <joint name="{link.joint}" type="{link.kind}">\n'
            f'    <parent link="{parent}"/>\n    <child link="{link.name}"/>\n'
            f'    <origin xyz="{_text(link.origin)}"/>\n    <axis xyz="{_text(link.axis)}"/>\n'
            f'    <limit lower="-{reach}" upper="{reach}" effort="{most:.6g}" velocity="{fastest:.6g}"/>\n'
            f"{_dynamics(link)}  </joint>"
        )
        parent = link.name
    return "\n".join([*parts, "</robot>\n"])


def _text(values: list[float] | tuple[float, ...]) -> str:
    return " ".join(f"{float(v):.9g}" for v in values)


def _dynamics(link: Link) -> str:
    if not (link.friction or link.damping):
        return ""
    return f'    <dynamics friction="{link.friction:.6g}" damping="{link.damping:.6g}"/>\n'
