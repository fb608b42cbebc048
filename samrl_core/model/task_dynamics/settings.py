"""Numbers of the tasks' physics."""

from __future__ import annotations

from dataclasses import dataclass, field

from samrl_core.cell.control.cartesian import ACTION_S
from samrl_core.common.errors import InputError
from samrl_core.model.physics.scene import ContactPair, PhysicsScene


@dataclass(frozen=True)
class ContactSettings:
    """Contact of the model. The world's own stiffness is not known to it: ASSUMPTIONS, to be fitted."""

    step_s: float = 1.0 / 240.0  # of the physics [s]
    stiffness: float = 1.0e4  # per ball [N/m]
    chain_stiffness: float = 500.0  # per ball of a chain, whose links weigh grams [N/m]
    dissipation: float = ContactPair.dissipation  # of Hunt and Crossley [s/m]
    table_friction: float = 0.3  # [-]
    table_height: float = 0.0  # of its top in world [m]
    slip_speed: float = PhysicsScene.slip_speed  # below it friction fades [m/s]
    margin: float = 0.004  # balls farther from a solid are left out of a step [m]
    edge: float = 0.0005  # rounding of edges where the body states none [m]
    rim_balls: int = 64  # on a rim of a cylinder or a hole
    edge_balls: int = 9  # along an edge of a box
    link_balls: int = 4  # along a link of a chain


@dataclass(frozen=True)
class TaskPhysicsSettings:
    """Time of an action, and contact."""

    action_s: float = ACTION_S  # the tip moves, with minimal jerk [s]
    rest_s: float = 0.3  # then stands still, while the next image is taken and fitted [s]
    contact: ContactSettings = field(default_factory=ContactSettings)

    def __post_init__(self) -> None:
        if not (self.action_s >= self.contact.step_s and self.rest_s >= 0.0):
            raise InputError(
                f"action_s {self.action_s} s must be one step of {self.contact.step_s} s at least, rest_s "
                f"{self.rest_s} s must be at least 0"
            )
