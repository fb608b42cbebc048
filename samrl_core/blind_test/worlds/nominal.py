"""The two nominal arms of sealed worlds, their controllers and their commands; computed once, then cached."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from samrl_core.blind_test.engines.arm_body import ArmBody, read_arm_body, with_tool
from samrl_core.blind_test.worlds.world_cache import Arrays, load_or_compute
from samrl_core.cell.excitation.excitation_trajectory import gains, make_trajectory
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import ROLES, RobotSpec
from samrl_core.cell.robots.urdf import description_of
from samrl_core.cell.tasks import task_named
from samrl_core.cell.types.arm_description import ArmController, ArmDescription, NominalTool, Tolerances
from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.cell.types.pose import Pose

_SIGNAL = ("time", "position", "velocity", "acceleration", "effort")
SETS = {"A": "slow", "B": "multisine", "C": "task"}
TRAJECTORY_SETS = 6  # distinct ones per arm, so that results per trajectory can be cached
# Rotors as geared drives have them. Panda: menagerie's panda.xml. Rizon: ASSUMPTION, same order;
# menagerie's 3.17 kg m2 at the shoulder would make the described gains sluggish.
ARMATURE = {
    "tool_arm": np.full(7, 0.1),
    "camera_arm": np.array([0.5, 0.5, 0.25, 0.25, 0.08, 0.08, 0.08]),
}
# Joints whose torque changes its sign in the recordings; the others are held to one side by gravity.
REVERSING = {"tool_arm": (0, 1, 2, 6), "camera_arm": (0, 6)}


@dataclass(frozen=True, eq=False)
class NominalArm:
    """An arm of the cell with the tool that the cell gives it."""

    role: str
    spec: RobotSpec  # with `ARMATURE`
    tool: NominalTool
    bare: ArmBody
    body: ArmBody  # with tool
    model: ArmModel  # with tool; base axes
    urdf: str


@cache
def nominal_arm(role: str) -> NominalArm:
    """The arm in a role.

    Raises:
        InputError: a URDF that does not fit.
    """
    cell = cell_named()
    held = task_named("peg_insertion").scene(cell).tool
    tool = {
        "tool_arm": NominalTool(held.mass, held.center_of_mass, held.inertia),
        "camera_arm": NominalTool(cell.camera_mass, cell.camera_center_of_mass, cell.camera_inertia),
    }[role]
    spec = replace(cell.arm(role), armature=ARMATURE[role])
    bare = read_arm_body(spec)
    model = ArmModel(spec, Pose.identity(), payload_of(tool))
    return NominalArm(role, spec, tool, bare, with_tool(bare, tool), model, description_of(spec))


def payload_of(tool: NominalTool) -> Payload:
    """A tool as the arm model takes it."""
    return Payload(tool.mass, tool.center_of_mass, tool.inertia)


@cache
def world_command(role: str, number: int, letter: str, duration_s: float) -> JointSignal:
    """Command of excitation trajectory `letter` in set `number`; the same in every forge."""
    arm = nominal_arm(role)
    seed = 1000 * (1 + ROLES.index(role)) + 10 * number + "ABC".index(letter)
    asked = (arm.spec, payload_of(arm.tool), SETS[letter], seed, duration_s)

    def work() -> Arrays:
        made = make_trajectory(*asked)
        return {n: v for n in _SIGNAL if (v := getattr(made, n)) is not None}

    code = ("cell/excitation", "cell/robots", "cell/types")
    return JointSignal(**load_or_compute("programmes", code, ("numpy", "scipy", "pin"), asked, work))


def description(role: str, letter: str, tolerances: Tolerances) -> ArmDescription:
    """Description that a recording carries of its arm; trajectory C runs at other controller gains."""
    arm = nominal_arm(role)
    scale = gains(SETS[letter])
    controller = ArmController(
        joints=arm.spec.joint_names,
        stiffness=arm.spec.controller.stiffness * scale.stiffness,
        damping=arm.spec.controller.damping * scale.damping,
        period_s=arm.spec.controller.period_s,
        effort_limit=arm.spec.limits.effort,
        armature=ARMATURE[role],
    )
    return ArmDescription(role, arm.spec.joint_names, arm.urdf, controller, arm.tool, tolerances)


@dataclass(frozen=True, eq=False)
class Demands:
    """Demand of the three recordings of a trajectory set on each joint of the nominal arm, (J,)."""

    torque: np.ndarray  # largest [N m]
    gravity: np.ndarray  # largest of gravity alone [N m]
    lowest: np.ndarray  # [rad]
    highest: np.ndarray  # [rad]


@cache
def demands(role: str, number: int, duration_s: float) -> Demands:
    """Of trajectories A, B and C of a set, every tenth tick."""
    arm = nominal_arm(role)
    torques, weights, positions = [], [], []
    for letter in SETS:
        c = world_command(role, number, letter, duration_s)
        q, v, a = (np.asarray(x)[::10] for x in (c.position, c.velocity, c.acceleration))
        torque = np.stack([arm.model.inverse_dynamics(*row) for row in zip(q, v, a, strict=True)])
        torques.append(np.abs(torque))
        weights.append(np.abs([arm.model.gravity(row) for row in q]))
        positions.append(q)
    joined = np.concatenate(positions)
    return Demands(
        np.concatenate(torques).max(axis=0),
        np.concatenate(weights).max(axis=0),
        joined.min(axis=0),
        joined.max(axis=0),
    )
