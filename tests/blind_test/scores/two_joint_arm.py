"""A two-joint arm in closed loop, integrated here: recordings with one effect that is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from samrl_core.cell.types.arm_description import ArmController, ArmDescription, NominalTool
from samrl_core.cell.types.arm_recording import ArmRecording, JointSignal
from samrl_core.diagnosis.simulation.rigid_arm import RigidArm


def _link(name: str, mass: float) -> str:
    return (
        f"<link name='{name}'><inertial><origin xyz='0 0 0.15'/><mass value='{mass}'/>"
        "<inertia ixx='0.02' iyy='0.02' izz='0.005' ixy='0' ixz='0' iyz='0'/></inertial></link>"
    )


URDF = (
    "<robot name='two'><link name='base'/>" + _link("upper", 2.0) + _link("fore", 1.0) + "<link name='hand'/>"
    "<joint name='j1' type='revolute'><parent link='base'/><child link='upper'/><axis xyz='0 1 0'/>"
    "<limit lower='-3' upper='3' effort='40' velocity='3'/></joint>"
    "<joint name='j2' type='revolute'><origin xyz='0 0 0.3'/><parent link='upper'/><child link='fore'/>"
    "<axis xyz='0 1 0'/><limit lower='-3' upper='3' effort='20' velocity='3'/></joint>"
    "<joint name='tip' type='fixed'><origin xyz='0 0 0.3'/><parent link='fore'/><child link='hand'/></joint>"
    "</robot>"
)
JOINTS = ("j1", "j2")


def arm() -> ArmDescription:
    """The nominal arm with its controller and a tool."""
    controller = ArmController(
        JOINTS, np.array([400.0, 200.0]), np.array([20.0, 8.0]), effort_limit=np.array([40.0, 20.0]),
        armature=np.array([0.1, 0.05]),
    )  # fmt: skip
    return ArmDescription(
        "tool_arm", JOINTS, URDF, controller, NominalTool(0.3, np.array([0, 0, 0.05]), 1e-4 * np.eye(3))
    )


def record(
    name: str,
    seed: int,
    friction: Callable[[np.ndarray], np.ndarray] = lambda dq: np.zeros(2),
    gain: tuple[float, float] = (1.0, 1.0),
    duration: float = 5.0,
) -> ArmRecording:
    """Multisine motion; `friction` (2,) of velocity opposes the drive, which gives `gain` times commanded."""
    described = arm()
    c = described.controller
    assert c is not None
    assert c.armature is not None
    model = RigidArm(described)
    rng = np.random.default_rng(seed)
    time = np.arange(0, duration, c.period_s)
    omega = 2 * np.pi * np.array([0.15, 0.4, 0.9, 1.7])
    amplitude, phase = np.array([0.5, 0.25, 0.1, 0.03]), rng.uniform(0, 2 * np.pi, (2, 4))
    angle = omega * time[:, None, None] + phase
    q_d = (amplitude * np.sin(angle)).sum(axis=2) + np.array([0.6, 0.4])
    dq_d = (amplitude * omega * np.cos(angle)).sum(axis=2)
    q, dq = q_d[0].copy(), dq_d[0].copy()
    rows: list[np.ndarray] = []
    for k in range(len(time)):
        gravity = model.gravity(q[None])[0]
        u = c.stiffness * (q_d[k] - q) + c.damping * (dq_d[k] - dq) + gravity
        bias = model.inverse_dynamics(q[None], dq[None], np.zeros((1, 2)))[0]
        drive = np.asarray(gain) * u - friction(dq)
        ddq = np.linalg.solve(model.mass_matrix(q[None])[0] + np.diag(c.armature), drive - bias)
        rows.append(np.concatenate([q, dq, drive - c.armature * ddq, u]))
        dq = dq + c.period_s * ddq
        q = q + c.period_s * dq
    data = np.array(rows) + rng.normal(0, [1e-5] * 2 + [1e-4] * 2 + [0.01] * 4, (len(time), 8))
    return ArmRecording(
        name, name, "", described,
        JointSignal(time, data[:, :2], data[:, 2:4], effort=data[:, 4:6]),
        JointSignal(time, q_d, dq_d, effort=np.zeros_like(q_d)),
        JointSignal(time, effort=data[:, 6:8]),
    )  # fmt: skip
