"""An `ArmBody` written as URDF for Bullet and as MJCF for MuJoCo."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.engines.arm_body import ArmBody, MovingLink
from samrl_core.cell.types.pose import Pose, quaternion_from_rotation, rpy_from_rotation


def _text(values: np.ndarray | tuple[float, ...]) -> str:
    return " ".join(f"{float(v):.12g}" for v in values)


def principal(link: MovingLink) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,) and axes (3, 3), right-handed: Bullet keeps only a diagonal."""
    moments, axes = np.linalg.eigh(link.inertia)
    if np.linalg.det(axes) < 0:
        axes = axes * np.array([1.0, 1.0, -1.0])
    return moments, axes


def urdf_text(body: ArmBody) -> str:
    """URDF without shapes."""
    # A base without inertia would be given 1 kg, with a warning.
    parts = [
        '<robot name="arm"><link name="base"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    ]
    parent = "base"
    for link in body.links:
        moments, axes = principal(link)
        pose: Pose = link.placement_in_parent
        kind = "prismatic" if link.slides else "continuous"
        limit = '<limit lower="-1" upper="1" effort="1e6" velocity="1e6"/>' if link.slides else ""
        parts.append(
            f'<link name="{link.name}"><inertial><origin xyz="{_text(link.center_of_mass)}" '
            f'rpy="{_text(rpy_from_rotation(axes))}"/><mass value="{link.mass:.12g}"/>'
            f'<inertia ixx="{moments[0]:.12g}" ixy="0" ixz="0" '
            f'iyy="{moments[1]:.12g}" iyz="0" izz="{moments[2]:.12g}"/></inertial></link>'
            f'<joint name="{link.joint}" type="{kind}"><parent link="{parent}"/><child link="{link.name}"/>'
            f'<origin xyz="{_text(pose.position)}" rpy="{_text(rpy_from_rotation(pose.rotation))}"/>'
            f'<axis xyz="{_text(link.axis)}"/>{limit}</joint>'
        )
        parent = link.name
    return "".join([*parts, "</robot>"])


def mjcf_text(body: ArmBody, timestep: float) -> str:
    """MJCF without shapes, contacts or actuators; MuJoCo's own integrator with implicit damping."""
    head, tail = [], []
    for link in body.links:
        moments, axes = principal(link)
        pose, kind = link.placement_in_parent, "slide" if link.slides else "hinge"
        head.append(
            f'<body name="{link.name}" pos="{_text(pose.position)}" quat="{_wxyz(pose.quat_xyzw)}">'
            f'<inertial pos="{_text(link.center_of_mass)}" quat="{_wxyz(quaternion_from_rotation(axes))}" '
            f'mass="{link.mass:.12g}" diaginertia="{_text(moments)}"/>'
            f'<joint name="{link.joint}" type="{kind}" axis="{_text(link.axis)}"/>'
        )
        tail.append("</body>")
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{timestep}" integrator="implicitfast">'
        f'<flag contact="disable"/></option><worldbody>{"".join(head)}{"".join(tail)}</worldbody></mujoco>'
    )


def _wxyz(quat_xyzw: np.ndarray) -> str:
    return _text(np.roll(quat_xyzw, 1))
