"""A task's scene as a physics scene: a driven tip, its chain, movable bodies, and what stands fixed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.start import DOWN
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types import scene as things
from samrl_core.cell.types.pose import Pose
from samrl_core.model.physics.scene import Joint, JointKind, PhysicsBody, PhysicsScene
from samrl_core.model.physics.shapes import plane
from samrl_core.model.task_dynamics.contacts import ContactPairs, SceneBody
from samrl_core.model.task_dynamics.settings import ContactSettings
from samrl_core.model.task_dynamics.solids import UNTURNED, part_at, solid_of, solids_of

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Assembly:
    """A physics scene, and what its coordinates are: first the driven tip's three, then those named by the
    fields.
    """

    scene: PhysicsScene
    sprung: bool  # five more: by how much the tip gives way [m], and its tilts about x and y [rad]
    chain: tuple[things.ChainLink, ...]  # two coordinates each [rad]
    movable: tuple[str, ...]  # bodies with a free joint, seven coordinates each
    shifted: tuple[things.Body, ...]  # bodies whose position the parameters give, three coordinates each [m]


def assemble(task: Task, cell: CellSpec, settings: ContactSettings) -> Assembly:
    """Builds the scene.

    A tool that holds a chain or moves bodies is as stiff as its motion. One that can only meet what stands
    fixed must give way, by the arm's own compliance; its weight is held by the arm.

    Raises:
        InputError: a part has no solid.
    """
    s = settings
    scene = task.scene(cell)
    tool = scene.tool
    moved = task.body_poses(np.array([p.nominal for p in task.parameters()]))
    free = [body for body in scene.bodies if body.mass > 0.0]
    shifted = [body for body in scene.bodies if body.mass == 0.0 and body.name in moved]
    welded = [body for body in scene.bodies if body.mass == 0.0 and body.name not in moved]
    sprung = not (free or tool.chain)

    held = part_at(tool.parts, tool.tip_in_flange.position)
    bodies = _tip_bodies(task, cell, tool, held, s, sprung)
    tip = SceneBody(len(bodies) - 1, len(bodies[-1].shapes), tool.friction)
    first_link = len(bodies)
    bodies += _chain_bodies(tool.chain, tip.index)
    in_physics: dict[str, SceneBody] = {}
    for body in (*free, *shifted, *welded):
        shapes = solids_of(body, s.edge)
        in_physics[body.name] = SceneBody(len(bodies), len(shapes), body.friction)
        if body in free:
            made = PhysicsBody(body.name, body.mass, body.inertia, (Joint(JointKind.FREE),), shapes=shapes)
        else:  # welded or driven: its mass moves nothing
            shift = _drive() if body in shifted else ()
            pose_in_parent = Pose.from_rotation(np.zeros(3), body.body_in_world.rotation)
            weld = Joint(
                JointKind.WELD, joint_in_parent=pose_in_parent if body in shifted else body.body_in_world
            )
            made = PhysicsBody(body.name, 1.0, np.eye(3), (*shift, weld), shapes=shapes)
        bodies.append(made)

    fixed = [in_physics[body.name] for body in (*shifted, *welded)]
    loose = [in_physics[body.name] for body in free]
    pairs = ContactPairs(s)
    pairs.chain(tool.chain, first_link, fixed)
    for body in free:
        pairs.movable(body, in_physics[body.name], fixed, tip)
    for body in (*shifted, *welded):
        pairs.edges(body, in_physics[body.name], [*loose, tip] if sprung else loose)
    pairs.held(tool, held, tip, fixed, loose)
    physics = PhysicsScene(
        tuple(bodies),
        (plane(Pose(np.array([0.0, 0.0, s.table_height]), UNTURNED)),),
        tuple(pairs.found),
        gravity=(0.0, 0.0, 0.0 if sprung else -9.81),
        step_s=s.step_s,
        slip_speed=s.slip_speed,
        contact_margin=s.margin,
    )
    return Assembly(physics, sprung, tool.chain, tuple(body.name for body in free), tuple(shifted))


def _drive() -> tuple[Joint, ...]:
    return tuple(Joint(JointKind.PRISMATIC, axis, driven=True) for axis in AXES)


def _tip_bodies(
    task: Task, cell: CellSpec, tool: things.Tool, held: things.Part | None, s: ContactSettings, sprung: bool
) -> list[PhysicsBody]:
    """What is held, in the frame of the tip: moved along the base's axes, not turned but by giving way."""
    down = Joint(JointKind.WELD, joint_in_parent=Pose.from_rotation(np.zeros(3), DOWN))
    flange_in_tip = tool.tip_in_flange.inverse()
    shapes = ()
    if held is not None:
        shapes = (solid_of(replace(held, part_in_body=flange_in_tip @ held.part_in_body), s.edge),)
    if not sprung:  # driven: its mass moves nothing
        return [PhysicsBody(tool.name, tool.mass, tool.inertia, (*_drive(), down), shapes=shapes)]
    grip = grip_of(task, cell)
    center = flange_in_tip.apply(tool.center_of_mass)
    joints = []
    for kind, stiffness, inertia in (
        (JointKind.PRISMATIC, grip.along, np.full(3, tool.mass)),
        (JointKind.REVOLUTE, grip.about, np.full(2, tool.mass * float(center @ center))),
    ):
        for axis, k, m in zip(AXES, stiffness.tolist(), inertia.tolist(), strict=False):
            joints.append(Joint(kind, axis, stiffness=k, damping=2.0 * float(np.sqrt(k * m))))
    turn = flange_in_tip.rotation
    carriage = PhysicsBody("carriage", 1.0, np.eye(3), _drive())
    com = (float(center[0]), float(center[1]), float(center[2]))
    inertia = turn @ tool.inertia @ turn.T
    return [carriage, PhysicsBody(tool.name, tool.mass, inertia, (*joints, down), com, 0, shapes)]


def _chain_bodies(chain: tuple[things.ChainLink, ...], tip: int) -> list[PhysicsBody]:
    bodies = []
    for i, link in enumerate(chain):
        start = Pose(np.array([0.0, 0.0, chain[i - 1].length if i else 0.0]), UNTURNED)
        about_x, about_y = (
            Joint(JointKind.REVOLUTE, axis, pose_in_parent, stiffness=link.stiffness, damping=link.damping)
            for axis, pose_in_parent in ((AXES[0], start), (AXES[1], Pose.identity()))
        )
        center = (float(link.center_of_mass[0]), float(link.center_of_mass[1]), float(link.center_of_mass[2]))
        bodies.append(PhysicsBody(link.name, link.mass, link.inertia, (about_x, about_y), center, tip + i))
    return bodies


@dataclass(frozen=True, eq=False)
class GripCompliance:
    """Springs along and about the tool arm's base axes, at the tip; the spin about z is left out."""

    along: np.ndarray  # (3,) [N/m]
    about: np.ndarray  # (2,) of x and y [N m/rad]


def grip_of(task: Task, cell: CellSpec) -> GripCompliance:
    """The compliance J K^-1 J^T of the arm in the task's start pose; what couples its axes is left out."""
    arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
    joints = task.start_joints(cell)["tool_arm"]
    jacobian = arm.jacobian(joints)
    lever = arm.flange_in_base(joints).rotation @ task.scene(cell).tool.tip_in_flange.position
    linear = jacobian[:3] + np.cross(jacobian[3:].T, lever).T
    whole = np.vstack([linear, jacobian[3:]])
    give = np.einsum("ij,j,ij->i", whole, 1.0 / cell.tool_arm.controller.stiffness, whole)
    return GripCompliance(1.0 / give[:3], 1.0 / give[3:5])
