"""What a recording says of its arm: nominal URDF, controller, tool and how well each is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from samrl_core.cell.types.drive_law import DriveLaw
from samrl_core.cell.types.stated_tolerances import StatedTolerances
from samrl_core.common.errors import InputError

HELD, LINE = "held", "line"  # a command between two stamps: until the next one, or straight
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # in the arm's base frame [m/s2]


@dataclass(frozen=True)
class Tolerances(StatedTolerances):
    """How far the real arm may be from its nominal model and still count as nominal.

    Per-joint values are one number for all joints, or one per joint.
    """

    mass: float = 0.02  # of each link, as a fraction
    center_of_mass: float = 0.002  # of each link, per axis [m]
    inertia: float = 0.03  # of each link's moments, as a fraction
    tool_mass: float = 0.02  # of the payload at the flange, as a fraction
    torque_offset: float | tuple[float, ...] = 0.004  # fraction of the joint's effort limit, drive and sensor
    coulomb_friction: float | tuple[float, ...] = 0.001  # fraction of the joint's effort limit
    viscous_friction: float | tuple[float, ...] = 0.001  # fraction of effort limit over velocity limit
    base_tilt: float = 0.0005  # per horizontal axis [rad]
    armature: float = 0.02  # fraction of the nominal value
    stamp: float = 0.0002  # of a channel against another, constant in a recording [s]
    motor_constant: float | tuple[float, ...] = 0.01  # of a motor: torque per volt or ampere, a fraction

    def check_joints(self, joints: Sequence[str], where: str) -> None:
        """Whether values per joint are as many as an arm has joints.

        Raises:
            InputError: more or fewer of them; the message begins with `where`.
        """
        for name, value in vars(self).items():
            if isinstance(value, tuple) and len(value) != len(joints):
                raise InputError(
                    f"{where}: tolerance {name} has {len(value)} numbers for {len(joints)} joints"
                    f" ({', '.join(joints)}); give one for all of them, or one for each"
                )

    def scaled(self, factor: float) -> Tolerances:
        """Every value times a factor."""
        values: dict[str, Any] = {
            name: tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
            for name, value in vars(self).items()
            if name != "stated_as"
        }
        return Tolerances(**values, stated_as=self.stated_as)


@dataclass(frozen=True, eq=False)
class ArmController:
    """The described controller: effort = clip(K (q_d - q) + D (dq_d - dq) + g(q) + feed-forward).

    `law` holds what other kinds add to it. `kind` and `stated` are its name and keys as they were described.
    """

    joints: tuple[str, ...]
    stiffness: np.ndarray  # (J,) [N m/rad]
    damping: np.ndarray  # (J,) [N m s/rad]
    period_s: float = 0.001  # [s]
    gravity_compensation: bool = True
    gravity: tuple[float, float, float] = STANDARD_GRAVITY  # in the arm's base frame [m/s2]
    effort_limit: np.ndarray | None = None  # (J,) [N m]; None: the URDF's
    armature: np.ndarray | None = None  # (J,) rotor inertia seen at the joint [kg m2]; None: zero
    law: DriveLaw = field(default_factory=DriveLaw)
    kind: str = "joint_impedance"
    stated: Mapping[str, Any] = field(default_factory=dict)  # keys of the kind, where it has its own
    between_commands: str = LINE  # or HELD


@dataclass(frozen=True, eq=False)
class NominalTool:
    """Nominal payload at the flange; inertia about its centre of mass in flange axes."""

    mass: float  # [kg]
    center_of_mass: np.ndarray  # (3,) [m]
    inertia: np.ndarray  # (3, 3) [kg m2]


@dataclass(frozen=True, eq=False)
class ArmDescription:
    """Everything nominal about one arm. `controller` is None for logs that carry none.

    `urdf` is None where no model exists at all (then the command itself is the nominal answer).
    The flange, to which the tool is fixed, is the last link of the URDF's only chain that holds the joints.
    """

    role: str  # `tool_arm` or `camera_arm`
    joints: tuple[str, ...]
    urdf: str | None  # XML text
    controller: ArmController | None
    tool: NominalTool | None = None
    tolerances: Tolerances = field(default_factory=Tolerances)
