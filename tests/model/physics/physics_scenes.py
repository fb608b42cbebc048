"""Scenes of the physics tests beside the benchmarks': peg in hole, thread in eye, spatula under pancake."""

from __future__ import annotations

import numpy as np

from samrl_core.model.physics.scene import WORLD, ContactPair, Joint, JointKind, PhysicsBody, PhysicsScene
from samrl_core.model.physics.shapes import box, cylinder, plane, ring
from samrl_core.studies.speed.physics_scenes import at, chain, circle, cylinder_inertia

FREE = Joint(JointKind.FREE)
HAND = Joint(JointKind.FREE, driven=True)


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
    hand = PhysicsBody("hand", 0.5, 1e-3 * np.eye(3), (HAND,))
    shaft = cylinder(0.01, 0.06, 0.0005, at(0, 0, -0.03))
    peg = PhysicsBody(
        "peg", 0.05, cylinder_inertia(0.05, 0.01, 0.06), tuple(springs), (0, 0, -0.03), 0, (shaft,)
    )
    hole = ring(0.012, 0.06, 0.04, 0.002, 0.0005)
    block = PhysicsBody("block", 1.0, 1e-2 * np.eye(3), (HAND,), shapes=(hole,))
    rim = circle(0.0125, 0.0175, 12)  # balls of 0.5 mm under the chamfer
    pairs = (ContactPair(1, circle(0.01, -0.06, 12), 2, 0), ContactPair(2, rim, 1, 0, 0.0005))
    return PhysicsScene((hand, peg, block), (), pairs)


def thread_in_eye(links: int = 10) -> PhysicsScene:
    """A thread of 10 mm links, radius 2 mm, on a driven hand; an eye of radius 7 mm, 4 mm thick."""
    hand = PhysicsBody("hand", 0.5, 1e-3 * np.eye(3), (HAND,))
    thread = [
        PhysicsBody(b.name, b.mass, b.inertia, b.joints, b.com, b.parent + 1)
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
    blade = PhysicsBody("blade", 0.1, 1e-4 * np.eye(3), (HAND,), shapes=(box((0.045, 0.04, 0.001), 0.0005),))
    cake = PhysicsBody("cake", 0.08, cylinder_inertia(0.08, 0.05, 0.012), (FREE,))
    rim = circle(0.044, 0.0, 16)  # balls of 6 mm: a rounded rim of radius 5 cm
    return PhysicsScene(
        (blade, cake),
        (plane(),),
        (
            ContactPair(1, rim, WORLD, 0, 0.006, friction=0.6, stiffness=2e3),
            ContactPair(1, rim, 0, 0, 0.006, friction=0.2, stiffness=2e3),
        ),
    )
