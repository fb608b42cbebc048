"""What the physics is made of: bodies on joints, and which points of which body may touch which solid."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.physics.shapes import Shape

WORLD = -1


class JointKind(IntEnum):
    """What the kernels switch on."""

    WELD = 0
    REVOLUTE = 1
    PRISMATIC = 2
    FREE = 3


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint. A body may have several in a row: two revolute ones make a universal joint.

    A driven joint's velocity is commanded: it is the action. A free joint has 7 coordinates (position [m]
    and quaternion xyzw of the body in the world) and 6 velocities (of the body's origin [m/s], then
    angular [rad/s], both in world axes).
    """

    kind: JointKind
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)  # unit, in the joint's frame; unused if free or weld
    joint_in_parent: Pose = field(default_factory=Pose.identity)  # of the joint before, or of the parent body
    driven: bool = False
    stiffness: float = 0.0  # [N m/rad] or [N/m]
    damping: float = 0.0  # [N m s/rad] or [N s/m]; of a free joint, both for its velocities
    rest: float = 0.0  # coordinate without spring force [rad] or [m]

    def __post_init__(self) -> None:
        axis = np.array(self.axis, dtype=np.float64)
        if axis.shape != (3,) or abs(float(np.linalg.norm(axis)) - 1.0) > 1e-6:
            raise InputError(f"joint axis {self.axis} must have 3 components and length 1; normalise it")
        values = np.array([self.stiffness, self.damping, self.rest])
        if not np.isfinite(values).all() or min(self.stiffness, self.damping) < 0:
            raise InputError(
                f"joint stiffness {self.stiffness} and damping {self.damping} must be at least 0"
            )
        if self.stiffness > 0 and self.kind in (JointKind.FREE, JointKind.WELD):
            raise InputError("a free or welded joint has no spring; use revolute or prismatic joints")


@dataclass(frozen=True, eq=False)
class PhysicsBody:
    """A rigid body behind its joints; its frame is that after its last joint."""

    name: str
    mass: float  # [kg]
    inertia: np.ndarray  # (3, 3) about the centre of mass, in the body's axes [kg m^2]
    joints: tuple[Joint, ...]
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)  # centre of mass in the body [m]
    parent: int = WORLD  # index of an earlier body
    shapes: tuple[Shape, ...] = ()  # that points of others may touch


@dataclass(frozen=True, eq=False)
class ContactPair:
    """Points of one body against one solid of another body or of the world.

    Each point is the centre of a ball. The normal force is k x (1 + d dx/dt), with x the ball's depth in the
    solid (Hunt and Crossley 1975); friction is Coulomb's, regularised near zero speed.
    """

    point_body: int
    points: np.ndarray  # (K, 3) in that body [m]
    solid_body: int  # WORLD for one of the scene's own solids
    solid: int  # index in that body's shapes, or in the scene's
    point_radius: float = 0.0  # [m]
    friction: float = 0.3  # [-]
    stiffness: float = 5.0e3  # k, per point [N/m]
    dissipation: float = 10.0  # d [s/m]


@dataclass(frozen=True, eq=False)
class PhysicsScene:
    """All bodies, the world's solids, the contacts, and the numbers of the time step.

    Raises:
        InputError: mass, inertia, index or size that no rigid body can have.
    """

    bodies: tuple[PhysicsBody, ...]
    world_shapes: tuple[Shape, ...] = ()
    contacts: tuple[ContactPair, ...] = ()
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)  # [m/s^2]
    step_s: float = 1.0 / 240.0
    slip_speed: float = 1.0e-3  # below it friction fades, and what holds creeps [m/s]
    touch_softness: float = 1.0e-5  # depth over which first touch is smooth [m]
    contact_margin: float = 0.01  # points farther away are left out of a step [m]
    iterations: int = 50  # of Newton's method, at most

    def __post_init__(self) -> None:
        if not self.bodies:
            raise InputError("a scene needs at least one body")
        for index, body in enumerate(self.bodies):
            _check_body(index, body)
        for pair in self.contacts:
            self._check_pair(pair)
        positive = (self.step_s, self.slip_speed, self.touch_softness, self.contact_margin, self.iterations)
        if not (np.isfinite(positive).all() and min(positive) > 0 and np.isfinite(self.gravity).all()):
            raise InputError(f"step, speeds, lengths and iterations {positive} must be finite and positive")

    def _check_pair(self, pair: ContactPair) -> None:
        count = len(self.bodies)
        if not (0 <= pair.point_body < count and WORLD <= pair.solid_body < count):
            raise InputError(
                f"contact between bodies {pair.point_body} and {pair.solid_body}: 0..{count - 1}"
            )
        if pair.point_body == pair.solid_body:
            raise InputError(f"body {pair.point_body} cannot touch itself")
        shapes = self.world_shapes if pair.solid_body == WORLD else self.bodies[pair.solid_body].shapes
        if not 0 <= pair.solid < len(shapes):
            raise InputError(f"contact names solid {pair.solid} of {len(shapes)} of body {pair.solid_body}")
        points = np.asarray(pair.points)
        if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
            raise InputError(f"contact points have shape {points.shape}, must be finite and (K, 3), K > 0")
        values = np.array([pair.point_radius, pair.friction, pair.dissipation])
        if not np.isfinite(values).all() or (values < 0).any() or not pair.stiffness > 0:
            raise InputError(
                f"contact radius, friction, dissipation {values} must be at least 0, stiffness "
                f"{pair.stiffness} N/m above 0"
            )


def _check_body(index: int, body: PhysicsBody) -> None:
    if not (np.isfinite(body.mass) and body.mass > 0):
        raise InputError(f"mass {body.mass} kg of {body.name} must be positive; weld it to what carries it")
    inertia = np.asarray(body.inertia, dtype=np.float64)
    if inertia.shape != (3, 3) or not np.isfinite(inertia).all() or not np.allclose(inertia, inertia.T):
        raise InputError(f"inertia of {body.name} must be finite, symmetric and (3, 3), got {inertia}")
    principal = np.linalg.eigvalsh(inertia)
    if principal[0] <= 1e-9 * principal[2] or principal[2] <= 0:
        raise InputError(f"inertia of {body.name} is singular: principal moments {principal} kg m^2")
    if principal[2] > (principal[0] + principal[1]) * (1 + 1e-6):
        raise InputError(
            f"no body has principal moments {principal} kg m^2 ({body.name}): triangle inequality"
        )
    if not np.isfinite(body.com).all():
        raise InputError(f"centre of mass {body.com} of {body.name} is not finite")
    if not WORLD <= body.parent < index:
        raise InputError(f"{body.name} (body {index}) has parent {body.parent}, must be an earlier body")
    for order, joint in enumerate(body.joints):
        if joint.kind == JointKind.FREE and (body.parent != WORLD or order > 0 or len(body.joints) > 1):
            raise InputError(f"{body.name}: a free joint must be its only joint, with the world as parent")
    if not body.joints:
        raise InputError(f"{body.name} has no joint; give it a weld, a revolute, a prismatic or a free one")
