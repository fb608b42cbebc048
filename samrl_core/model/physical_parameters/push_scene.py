"""The model of a push: an upright blade with the arm's effective mass meets a disc that slides on a table.

Eq. 9's simulation. The blade is one body on a prismatic joint along the line of the push, moved by the
arm's recorded drive; what the disc does to it is left to the contact. The disc is free in all six directions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError
from samrl_core.model.physical_parameters.push_record import Disc, PushRecord
from samrl_core.model.physics.physics_model import PhysicsModel
from samrl_core.model.physics.scene import WORLD, ContactPair, Joint, JointKind, PhysicsBody, PhysicsScene
from samrl_core.model.physics.shapes import box, plane
from samrl_core.model.physics.state import PhysicsAction, PhysicsParameters, PhysicsState

BLADE, DISC = 0, 1  # bodies
RIM_POINTS = 8
# Logarithms of these are fitted, then the latency and one start per push.
NAMES = (
    "mass",
    "table_friction",
    "inertia_ratio",
    "blade_friction",
    "blade_stiffness",
    "blade_dissipation",
    "arm_mass_ratio",
    "force_ratio",
)
MASS, TABLE_FRICTION, INERTIA_RATIO, BLADE_FRICTION, BLADE_STIFFNESS, BLADE_DISSIPATION = range(6)
ARM_MASS_RATIO, FORCE_RATIO, LATENCY, START = range(6, 10)


@dataclass(frozen=True)
class PushContactSettings:
    """Of the model's contacts, what is not fitted. ASSUMPTION, all of it.

    The blade is the box of the tool's leading edge; its flat face is upright and square to the push.
    """

    blade_half_thickness: float = 0.001  # the tip is in the middle of the edge [m]
    blade_half_width: float = 0.040  # [m]
    blade_half_height: float = 0.025  # [m]
    # First touch must be smooth over about the way of one step: otherwise it would matter where in a step it
    # falls, the trajectory would follow the disc's start in steps too, and the fit would stop in one of them.
    touch_softness: float = 4.0e-4  # depth over which first touch is smooth [m]
    table_stiffness: float = 1.0e4  # per point of the rim [N/m]
    table_dissipation: float = 10.0  # [s/m]
    substeps: int = 1  # of the model in each of the arm's periods


class PushScene:
    """One push as a physics model; theta is (B, 10), whose last column is the start of this push.

    Args:
        disc: its shape.
        push: the record; its drive moves the blade.
        contact: stiffness of the contacts, and the time step.

    Raises:
        InputError: there is not one substep.
    """

    def __init__(self, disc: Disc, push: PushRecord, contact: PushContactSettings | None = None) -> None:
        contact = contact or PushContactSettings()
        if contact.substeps < 1:
            raise InputError(f"substeps is {contact.substeps}, must be at least 1")
        self.push, self.substeps = push, contact.substeps
        self.arm_mass = float(np.mean(push.effective_mass[: push.push_steps]))  # [kg]
        self._start_z = 0.5 * disc.thickness
        across = (3 * disc.radius**2 + disc.thickness**2) / 12
        self._inertia = torch.diag(torch.tensor([across, across, 0.5 * disc.radius**2], dtype=torch.float64))
        self.model = PhysicsModel(
            _scene(disc, self.arm_mass, push.period_s / self.substeps, contact), torch.float64
        )
        force = np.repeat(self.arm_mass * push.free_acceleration, self.substeps)
        self._force = torch.as_tensor(force)  # (T substeps,) [N]

    @property
    def coordinates(self) -> int:
        """Positions in a state; as many velocities follow."""
        return len(self.model.layout.start_q)

    @property
    def in_plane(self) -> list[int]:
        """Numbers of a state that can change when the push goes through the disc's middle: position of the
        blade, x, z and pitch of the disc (y and w of its quaternion), and their speeds.
        """
        return [0, 1, 3, 5, 7, *(self.coordinates + i for i in (0, 1, 3, 5))]

    @property
    def steps(self) -> int:
        """Steps of the model."""
        return len(self._force)

    def start(self, theta: torch.Tensor) -> PhysicsState:
        """Blade where it was measured, disc at theta's start, lying, all at rest."""
        state = self.model.start_state(len(theta))
        q = torch.zeros_like(state.q)
        q[:, 0] = float(self.push.tip[0])
        q[:, 3], q[:, 7] = self._start_z, 1.0
        direction = torch.zeros_like(q)
        direction[:, 1] = 1.0
        return PhysicsState(q + direction * theta[:, START, None], state.v)

    def action(self, theta: torch.Tensor, step: torch.Tensor) -> PhysicsAction:
        """Force on the blade in the model's steps `step` (B,), one per row of theta."""
        push = self._force[step] * torch.exp(theta[:, FORCE_RATIO])
        along = theta.new_zeros((1, 2, 6))
        along[0, BLADE, 0] = 1.0
        return PhysicsAction(theta.new_zeros((len(theta), 0)), along * push[:, None, None])

    def actions(self, theta: torch.Tensor) -> PhysicsAction:
        """Those of all steps, (T, B, ...)."""
        batch = len(theta)
        flat = self.action(theta.repeat(self.steps, 1), torch.arange(self.steps).repeat_interleave(batch))
        shape = (self.steps, batch)
        return PhysicsAction(flat.velocity.reshape(*shape, 0), flat.wrench.reshape(*shape, 2, 6))

    def parameters(self, theta: torch.Tensor) -> PhysicsParameters:
        """The scene's numbers, those of theta put in."""
        nominal = self.model.parameters(len(theta))
        values = torch.exp(theta)
        mass = torch.stack([self.arm_mass * values[:, ARM_MASS_RATIO], values[:, MASS]], dim=1)
        of_disc = (values[:, MASS] * values[:, INERTIA_RATIO])[:, None, None] * self._inertia
        return replace(
            nominal,
            mass=mass,
            inertia=torch.stack([nominal.inertia[:, BLADE], of_disc], dim=1),
            friction=torch.stack([values[:, TABLE_FRICTION], values[:, BLADE_FRICTION]], dim=1),
            contact_stiffness=torch.stack(
                [nominal.contact_stiffness[:, 0], values[:, BLADE_STIFFNESS]], dim=1
            ),
            contact_dissipation=torch.stack(
                [nominal.contact_dissipation[:, 0], values[:, BLADE_DISSIPATION]], dim=1
            ),
        )


def _scene(disc: Disc, arm_mass: float, step_s: float, contact: PushContactSettings) -> PhysicsScene:
    # The face of an upright blade meets a round rim as it would meet a ball of the disc's radius about the
    # disc's centre: one point, with no corners of a polygon to roll over.
    half_extents = (contact.blade_half_thickness, contact.blade_half_width, contact.blade_half_height)
    face = box(half_extents, 0.5 * contact.blade_half_thickness, _at(0.0, 0.0, 0.5 * disc.thickness))
    along = Joint(JointKind.PRISMATIC, (1.0, 0.0, 0.0))
    blade = PhysicsBody("blade", arm_mass, arm_mass * 1e-3 * np.eye(3), (along,), shapes=(face,))
    body = PhysicsBody("disc", 1.0, 1e-3 * np.eye(3), (Joint(JointKind.FREE),))
    angle = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(RIM_POINTS)]) * disc.rim_radius
    rim[:, 2] = -0.5 * disc.thickness
    pairs = (
        ContactPair(
            DISC, rim, WORLD, 0, stiffness=contact.table_stiffness, dissipation=contact.table_dissipation
        ),
        ContactPair(
            DISC,
            np.zeros((1, 3)),
            BLADE,
            0,
            disc.radius,
        ),
    )
    return PhysicsScene(
        (blade, body), (plane(),), pairs, step_s=step_s, touch_softness=contact.touch_softness
    )


def _at(x: float, y: float, z: float) -> Pose:
    return Pose(np.array([x, y, z]), np.array([0.0, 0.0, 0.0, 1.0]))
