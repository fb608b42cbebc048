"""A task's scene as a physics scene: a driven tip, its chain, movable bodies, and what stands fixed.

Who touches whom, with which points, is read off the parts: a chain's capsules and a movable cylinder's
rims are rows of balls against all solids; where a box may press its edge into a movable body (the blade,
the lip), balls along its edges meet that body's own solid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.errors import InputError
from samrl_core.model.physics.scene import WORLD, Body, ContactPair, Joint, JointKind, PhysicsScene
from samrl_core.model.physics.shapes import Shape, plane
from samrl_core.model.task_physics.solids import (
    UNTURNED,
    capsule_balls,
    edge_balls,
    part_at,
    rim_balls,
    solid_of,
    solids_of,
)
from samrl_core.robots.robot import CellSpec
from samrl_core.tasks.start import DOWN
from samrl_core.tasks.task import Task
from samrl_core.types import scene as parts
from samrl_core.types.pose import Pose

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class ContactSettings:
    """Contact of the model. The world's own stiffness is not known to it: ASSUMPTIONS, to be fitted."""

    step_s: float = 1.0 / 240.0  # of the physics [s]
    stiffness: float = 1.0e4  # per ball [N/m]
    chain_stiffness: float = 500.0  # per ball of a chain, whose links weigh grams [N/m]
    dissipation: float = 10.0  # of Hunt and Crossley [s/m]
    table_friction: float = 0.3  # [-]
    table_height: float = 0.0  # of its top in world [m]
    slip_speed: float = 1.0e-3  # below it friction fades [m/s]
    margin: float = 0.004  # balls farther from a solid are left out of a step [m]
    edge: float = 0.0005  # rounding of edges where the body states none [m]
    rim_balls: int = 32  # on each rim of a movable cylinder
    edge_balls: int = 9  # along an edge of a box
    link_balls: int = 4  # along a link of a chain


@dataclass(frozen=True, eq=False)
class Assembly:
    """A physics scene, and where in its coordinates things stand: the tip is 0..2."""

    scene: PhysicsScene
    chain: tuple[parts.ChainLink, ...]  # two coordinates each, from 3 on
    movable: tuple[str, ...]  # bodies with a free joint, 7 coordinates each, after the chain


def assemble(task: Task, cell: CellSpec, settings: ContactSettings) -> Assembly:
    """Builds the scene.

    Raises:
        InputError: a part has no solid, or the parameters move a body that is not free to move.
    """
    s = settings
    scene = task.scene(cell)
    tool = scene.tool
    nominal = np.array([p.nominal for p in task.parameters()])
    movable = [body for body in scene.bodies if body.mass > 0.0]
    unknown = set(task.body_poses(nominal)) - {body.name for body in movable}
    if unknown:
        raise InputError(f"task {task.name} moves {sorted(unknown)}, which have no mass; give them one")
    held = part_at(tool.parts, tool.tip_in_flange.position)
    bodies = [_tip_body(tool, held, s)]
    bodies += _chain_bodies(tool.chain)
    first_movable = len(bodies)
    bodies += [
        Body(b.name, b.mass, b.inertia, (Joint(JointKind.FREE),), shapes=solids_of(b, s.edge))
        for b in movable
    ]
    fixed = [body for body in scene.bodies if body.mass == 0.0]
    first_fixed = len(bodies)
    bodies += [_fixed_body(body, s) for body in fixed]

    pairs: list[ContactPair] = []
    pair = _Pairs(s)
    for k, link in enumerate(tool.chain):
        for part in link.parts:
            if not isinstance(part, parts.Capsule):
                raise InputError(f"link {link.name} has a part that is no capsule; chains touch with capsules")
            balls = capsule_balls(part, s.link_balls)
            for j, other in enumerate(fixed):
                for solid in range(len(bodies[first_fixed + j].shapes)):
                    made = pair(1 + k, balls, part.radius, first_fixed + j, solid, link.friction, other.friction)
                    pairs.append(replace(made, stiffness=s.chain_stiffness))
    for k, body in enumerate(movable):
        me = first_movable + k
        for part in body.parts:
            if not isinstance(part, parts.Cylinder) or body.rounding <= 0.0:
                raise InputError(f"movable body {body.name} must be made of cylinders with rounded rims")
            balls = rim_balls(part, body.rounding, s.rim_balls)
            pairs.append(pair(me, balls, body.rounding, WORLD, 0, body.friction, s.table_friction))
            solids = [(first_fixed + j, other.friction) for j, other in enumerate(fixed)]
            if held is not None:
                solids.append((0, tool.friction))
            for other, friction in solids:
                for solid in range(len(bodies[other].shapes)):
                    pairs.append(pair(me, balls, body.rounding, other, solid, body.friction, friction))
        edges = [(first_fixed + j, b.friction, _lip_edges(b, s)) for j, b in enumerate(fixed)]
        edges.append((0, tool.friction, _blade_edges(tool, held, s)))
        for other, friction, balls in edges:
            for solid in range(len(bodies[me].shapes) if len(balls) else 0):
                pairs.append(pair(other, balls, s.edge, me, solid, friction, body.friction))
    physics = PhysicsScene(
        tuple(bodies),
        (plane(Pose(np.array([0.0, 0.0, s.table_height]), UNTURNED)),),
        tuple(pairs),
        step_s=s.step_s,
        slip_speed=s.slip_speed,
        contact_margin=s.margin,
    )
    return Assembly(physics, tool.chain, tuple(body.name for body in movable))


class _Pairs:
    """Makes contact pairs; friction is the geometric mean of the two figures, as in the tasks."""

    def __init__(self, settings: ContactSettings) -> None:
        self._settings = settings

    def __call__(
        self,
        point_body: int,
        points: np.ndarray,
        radius: float,
        solid_body: int,
        solid: int,
        friction: float,
        other_friction: float,
    ) -> ContactPair:
        mean = float(np.sqrt(friction * other_friction))
        s = self._settings
        return ContactPair(point_body, points, solid_body, solid, radius, mean, s.stiffness, s.dissipation)


def _tip_body(tool: parts.Tool, held: parts.Part | None, s: ContactSettings) -> Body:
    """What is held, in the frame of the tip: moved along the base's axes, never turned."""
    joints = tuple(Joint(JointKind.PRISMATIC, axis, driven=True) for axis in AXES)
    turn = Joint(JointKind.WELD, joint_in_parent=Pose.from_rotation(np.zeros(3), DOWN))
    shapes: tuple[Shape, ...] = ()
    if held is not None:
        flange_in_tip = tool.tip_in_flange.inverse()
        shapes = (solid_of(replace(held, part_in_body=flange_in_tip @ held.part_in_body), s.edge),)
    # Driven: its mass moves nothing.
    return Body(tool.name, tool.mass, tool.inertia, (*joints, turn), shapes=shapes)


def _chain_bodies(chain: tuple[parts.ChainLink, ...]) -> list[Body]:
    bodies = []
    for i, link in enumerate(chain):
        start = Pose(np.array([0.0, 0.0, chain[i - 1].length if i else 0.0]), UNTURNED)
        springs = {"stiffness": link.stiffness, "damping": link.damping}
        joints = (
            Joint(JointKind.REVOLUTE, AXES[0], start, **springs),
            Joint(JointKind.REVOLUTE, AXES[1], **springs),
        )
        center = (float(link.center_of_mass[0]), float(link.center_of_mass[1]), float(link.center_of_mass[2]))
        bodies.append(Body(link.name, link.mass, link.inertia, joints, center, i))
    return bodies


def _fixed_body(body: parts.Body, s: ContactSettings) -> Body:
    # Welded to the world: its mass moves nothing.
    weld = Joint(JointKind.WELD, joint_in_parent=body.body_in_world)
    return Body(body.name, 1.0, np.eye(3), (weld,), shapes=solids_of(body, s.edge))


def _blade_edges(tool: parts.Tool, held: parts.Part | None, s: ContactSettings) -> np.ndarray:
    """Balls along the two leading edges of a box that the tool holds, in the tip's frame (N, 3) [m]."""
    if not isinstance(held, parts.Box):
        return np.zeros((0, 3))
    tip_in_part = held.part_in_body.inverse().apply(tool.tip_in_flange.position)
    ahead = 1 if tip_in_part[0] > 0 else -1
    balls = edge_balls(held, s.edge, 1, ((ahead, -1), (ahead, 1)), s.edge_balls)
    return tool.tip_in_flange.inverse().apply(balls)


def _lip_edges(body: parts.Body, s: ContactSettings) -> np.ndarray:
    """Balls along the two upper long edges of a fixed single box (N, 3) [m]; none of other bodies."""
    if len(body.parts) != 1 or not isinstance(body.parts[0], parts.Box):
        return np.zeros((0, 3))
    half = body.parts[0].half_extents
    axis = 0 if half[0] >= half[1] else 1
    return edge_balls(body.parts[0], s.edge, axis, ((-1, 1), (1, 1)), 2 * s.edge_balls)
