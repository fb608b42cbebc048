"""Scenes that every physics engine can build: a hanging chain, and a disc on a plane."""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.cell.types.pose import Pose
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import WORLD, ContactPair, Joint, JointKind, PhysicsBody, PhysicsScene
from samrl_core.model.physics.shapes import plane
from samrl_core.model.physics.state import PhysicsState

LINKS = 10
LENGTH, MASS, RADIUS, DAMPING = 0.1, 0.05, 0.02, 1e-3  # [m], [kg], [m], [N m s/rad]
DISC_RADIUS, DISC_HEIGHT, DISC_MASS = 0.08, 0.02, 0.1  # [m], [m], [kg]
DISC_FRICTION = 0.3  # [-]
DISC_SPEED = 0.5  # at the start [m/s]
STEP_S = 1.0 / 240.0


def at(x: float, y: float, z: float) -> Pose:
    """A pose that is not turned."""
    return Pose(np.array([x, y, z]), np.array([0.0, 0.0, 0.0, 1.0]))


def circle(radius: float, z: float, count: int) -> np.ndarray:
    """Points (count, 3) about z [m]."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)], axis=1)


def cylinder_inertia(mass: float, radius: float, length: float) -> np.ndarray:
    """Of a solid cylinder along z about its centre, (3, 3) [kg m^2]."""
    side = mass * (3 * radius**2 + length**2) / 12
    return np.diag([side, side, 0.5 * mass * radius**2])


def chain(
    links: int, length: float, mass: float, radius: float, stiffness: float, damping: float
) -> list[PhysicsBody]:
    """Links hanging along -z, two hinges in front of each."""
    inertia = cylinder_inertia(mass, radius, length)
    bodies = []
    for i in range(links):
        joints = (
            Joint(JointKind.REVOLUTE, (1, 0, 0), at(0, 0, -length if i else 0), False, stiffness, damping),
            Joint(JointKind.REVOLUTE, (0, 1, 0), stiffness=stiffness, damping=damping),
        )
        bodies.append(PhysicsBody(f"link {i}", mass, inertia, joints, (0, 0, -length / 2), i - 1))
    return bodies


def free_chain() -> PhysicsScene:
    """10 links of 0.1 m and 50 g, 20 DoF, hung from the world."""
    return PhysicsScene(tuple(chain(LINKS, LENGTH, MASS, RADIUS, 0.0, DAMPING)))


def chain_start(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Angles [rad] and rates [rad/s], (20,) each."""
    rng = np.random.default_rng(seed)
    return 0.4 * rng.normal(size=2 * LINKS), rng.normal(size=2 * LINKS)


def disc_on_plane(step_s: float = STEP_S, friction: float = DISC_FRICTION) -> PhysicsScene:
    """A disc of 0.1 kg, radius 8 cm, 2 cm thick, on eight points of its lower rim."""
    inertia = cylinder_inertia(DISC_MASS, DISC_RADIUS, DISC_HEIGHT)
    body = PhysicsBody("disc", DISC_MASS, inertia, (Joint(JointKind.FREE),))
    pair = ContactPair(0, circle(DISC_RADIUS, -0.5 * DISC_HEIGHT, 8), WORLD, 0, friction=friction)
    return PhysicsScene((body,), (plane(),), (pair,), step_s=step_s)


def moving_start(model: PhysicsModel, batch: int) -> PhysicsState:
    """Every environment alike: the free chain at `chain_start`, the disc on the plane sliding along x."""
    state = model.start_state(batch)
    if model.scene.contacts:
        state.q[:, 2], state.v[:, 0] = 0.5 * DISC_HEIGHT, DISC_SPEED
    else:
        state.q[:], state.v[:] = (torch.from_numpy(x) for x in chain_start())
    return state
