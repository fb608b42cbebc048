"""Arms for the tests: the cell's two, a slide and a branched tree with a continuous joint."""

from __future__ import annotations

from typing import Any

import numpy as np

from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.robots.rizon.spec import RIZON4
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.cell.types.arm_description import ArmController, ArmDescription, NominalTool
from samrl_core.cell.types.arm_recording import JointSignal

_LINK = """<link name="{name}"><inertial><origin xyz="{com}" rpy="0.3 -0.2 0.5"/><mass value="{mass}"/>
<inertia ixx="{i[0]}" iyy="{i[1]}" izz="{i[2]}" ixy="0.0004" ixz="-0.0003" iyz="0.0002"/></inertial></link>"""
_JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" effort="60" velocity="5"/></joint>"""


def _link(name: str, mass: float, com: str, i: tuple[float, float, float]) -> str:
    return _LINK.format(name=name, mass=mass, com=com, i=i)


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, rpy: str, axis: str) -> str:
    return _JOINT.format(name=name, kind=kind, parent=parent, child=child, xyz=xyz, rpy=rpy, axis=axis)


SLIDE = (
    '<robot name="slide"><link name="base"/>'
    + _link("sled", 2.0, "0.02 0.01 0.03", (0.01, 0.012, 0.015))
    + _joint("slide", "prismatic", "base", "sled", "0 0 0.1", "0.2 -0.4 0", "0 0.6 0.8")
    + "</robot>"
)
TREE = (
    '<robot name="tree"><link name="base"/>'
    + _link("trunk", 3.0, "0 0.02 0.2", (0.04, 0.05, 0.03))
    + _link("left", 1.2, "0.1 0.01 0", (0.008, 0.012, 0.011))
    + _link("left_tip", 0.4, "0.05 0 0.02", (0.002, 0.003, 0.0025))
    + _link("right", 1.0, "0 -0.08 0.01", (0.009, 0.007, 0.01))
    + _joint("turn", "continuous", "base", "trunk", "0 0 0.05", "0 0.1 0", "0 0 1")
    + _joint("left_arm", "revolute", "trunk", "left", "0 0.05 0.4", "0.3 0 0.2", "0 1 0")
    + _joint("right_arm", "revolute", "trunk", "right", "0 -0.05 0.4", "0 0 -0.4", "0.6 0 0.8")
    + _joint("left_slide", "prismatic", "left", "left_tip", "0.2 0 0", "0 0.5 0", "1 0 0")
    + "</robot>"
)


def description(
    urdf: str,
    joints: tuple[str, ...],
    stiffness: Any,
    damping: Any,
    tool: NominalTool | None = None,
    **controller: Any,
) -> ArmDescription:
    count = len(joints)
    control = ArmController(
        joints,
        np.broadcast_to(stiffness, count).astype(float),
        np.broadcast_to(damping, count).astype(float),
        **controller,
    )  # fmt: skip
    return ArmDescription("tool_arm", joints, urdf, control, tool)


def of_spec(spec: RobotSpec, tool: NominalTool | None = None, **controller: Any) -> ArmDescription:
    gains = spec.controller
    return description(
        spec.urdf.read_text(), spec.joint_names, gains.stiffness, gains.damping, tool, **controller
    )


HAND = NominalTool(0.78, np.array([0.01, -0.02, 0.05]), np.diag([0.002, 0.0025, 0.001]))
# name: description, start
ARMS: dict[str, tuple[ArmDescription, np.ndarray]] = {
    "panda": (of_spec(PANDA, HAND), PANDA.home),
    "rizon": (of_spec(RIZON4), RIZON4.home),
    "slide": (description(SLIDE, ("slide",), 200.0, 20.0), np.array([0.1])),
    # listed in another order than the tree's
    "tree": (
        description(TREE, ("left_arm", "left_slide", "turn", "right_arm"), 80.0, 6.0),
        np.array([0.3, 0.05, -0.4, 0.5]),
    ),
}


def free(arm: ArmDescription) -> ArmDescription:
    """The same arm with a controller that does nothing."""
    assert arm.urdf is not None
    return description(
        arm.urdf, arm.joints, 0.0, 0.0, arm.tool, gravity_compensation=False,
        effort_limit=np.full(len(arm.joints), 1e3),
    )  # fmt: skip


def swing(start: np.ndarray, duration_s: float, amplitude: float = 0.2, rate_hz: float = 1.0) -> JointSignal:
    """A smooth there and back of all joints, each later than the one before."""
    time = np.arange(0.0, duration_s + 0.0015, 0.001)
    phase = 2 * np.pi * rate_hz * time[:, None] * (1 - 0.07 * np.arange(len(start)))
    rate = 2 * np.pi * rate_hz * (1 - 0.07 * np.arange(len(start)))
    position = start + amplitude * (1 - np.cos(phase))
    return JointSignal(time, position, amplitude * rate * np.sin(phase), effort=np.zeros_like(position))


def still(start: np.ndarray) -> JointSignal:
    return JointSignal(np.array([0.0]), start[None], np.zeros((1, len(start))))
