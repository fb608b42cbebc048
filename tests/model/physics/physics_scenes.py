"""Scenes of the physics tests: chain, sliding disc, peg in hole, thread in eye, spatula under pancake."""

from __future__ import annotations

import numpy as np

from samrl_core.model.physics.scene import WORLD, Body, ContactPair, Joint, JointKind, PhysicsScene
from samrl_core.model.physics.shapes import block_with_hole, box, cylinder, plane, ring
from samrl_core.types.pose import Pose

FREE = Joint(JointKind.FREE)
HAND = Joint(JointKind.FREE, driven=True)
UNIT = (0.0, 0.0, 0.0, 1.0)


def at(x: float, y: float, z: float) -> Pose:
    return Pose(np.array([x, y, z]), np.array(UNIT))


def circle(radius: float, z: float, count: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)], axis=1)


def cylinder_inertia(mass: float, radius: float, length: float) -> np.ndarray:
    side = mass * (3 * radius**2 + length**2) / 12
    return np.diag([side, side, 0.5 * mass * radius**2])


def chain(
    links: int, length: float, mass: float, radius: float, stiffness: float, damping: float
) -> list[Body]:
    """Links hanging along -z, two hinges in front of each."""
    inertia = cylinder_inertia(mass, radius, length)
    bodies = []
    for i in range(links):
        joints = (
            Joint(JointKind.REVOLUTE, (1, 0, 0), at(0, 0, -length if i else 0), False, stiffness, damping),
            Joint(JointKind.REVOLUTE, (0, 1, 0), stiffness=stiffness, damping=damping),
        )
        bodies.append(Body(f"link {i}", mass, inertia, joints, (0, 0, -length / 2), i - 1))
    return bodies


def free_chain() -> PhysicsScene:
    """10 links of 0.1 m and 50 g, 20 DoF, hung from the world."""
    return PhysicsScene(tuple(chain(10, 0.1, 0.05, 0.02, 0.0, 1e-3)))


def disc_on_plane(step_s: float = 1 / 240, friction: float = 0.3) -> PhysicsScene:
    """A disc of 0.1 kg, radius 8 cm, 2 cm thick, on eight points of its lower rim."""
    body = Body("disc", 0.1, cylinder_inertia(0.1, 0.08, 0.02), (FREE,))
    pair = ContactPair(0, circle(0.08, -0.01, 8), WORLD, 0, friction=friction)
    return PhysicsScene((body,), (plane(),), (pair,), step_s=step_s)


def peg_in_hole() -> PhysicsScene:
    """A driven hand holds a peg of radius 10 mm by a springy wrist; a block has a chamfered hole of 12 mm.

    The block is driven too, so that the hole's pose is part of the state. The peg's points meet the hole
    and the hole's rim meets the peg's side: a tilted peg is held at both and jams.
    """
    springs = [
        Joint(JointKind.PRISMATIC, axis, stiffness=2000.0, damping=20.0)
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    ]
    springs += [
        Joint(JointKind.REVOLUTE, axis, stiffness=5.0, damping=0.05)
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    ]
    hand = Body("hand", 0.5, 1e-3 * np.eye(3), (HAND,))
    shaft = cylinder(0.01, 0.06, 0.0005, at(0, 0, -0.03))
    peg = Body("peg", 0.05, cylinder_inertia(0.05, 0.01, 0.06), tuple(springs), (0, 0, -0.03), 0, (shaft,))
    hole = block_with_hole((0.06, 0.06, 0.02), 0.012, 0.002, 0.0005)
    block = Body("block", 1.0, 1e-2 * np.eye(3), (HAND,), shapes=(hole,))
    rim = circle(0.0125, 0.0175, 12)  # balls of 0.5 mm under the chamfer
    pairs = (ContactPair(1, circle(0.01, -0.06, 12), 2, 0), ContactPair(2, rim, 1, 0, 0.0005))
    return PhysicsScene((hand, peg, block), (), pairs)


def thread_in_eye(links: int = 10) -> PhysicsScene:
    """A thread of 10 mm links, radius 2 mm, on a driven hand; an eye of radius 7 mm, 4 mm thick."""
    hand = Body("hand", 0.5, 1e-3 * np.eye(3), (HAND,))
    thread = [
        Body(b.name, b.mass, b.inertia, b.joints, b.com, b.parent + 1)
        for b in chain(links, 0.01, 0.0005, 0.002, 2e-3, 2e-5)
    ]
    eye = ring(0.007, 0.012, 0.004, 0.0005, 0.0005)
    balls = np.array([[0.0, 0.0, -0.0025], [0.0, 0.0, -0.005], [0.0, 0.0, -0.0075], [0.0, 0.0, -0.01]])
    pairs = tuple(
        ContactPair(i + 1, balls, WORLD, 0, 0.002, friction=0.2, stiffness=500.0) for i in range(links)
    )
    return PhysicsScene((hand, *thread), (eye,), pairs)


def spatula_and_pancake() -> PhysicsScene:
    """A driven blade of 90 x 80 x 2 mm pushes against a pancake of radius 5 cm on a table."""
    blade = Body("blade", 0.1, 1e-4 * np.eye(3), (HAND,), shapes=(box((0.045, 0.04, 0.001), 0.0005),))
    cake = Body("cake", 0.08, cylinder_inertia(0.08, 0.05, 0.012), (FREE,))
    rim = circle(0.044, 0.0, 16)  # balls of 6 mm: a rounded rim of radius 5 cm
    return PhysicsScene(
        (blade, cake),
        (plane(),),
        (
            ContactPair(1, rim, WORLD, 0, 0.006, friction=0.6, stiffness=2e3),
            ContactPair(1, rim, 0, 0, 0.006, friction=0.2, stiffness=2e3),
        ),
    )
