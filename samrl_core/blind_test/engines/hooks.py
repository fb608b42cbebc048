"""Where a disturbance may act along the chain from command to reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from samrl_core.blind_test.engines.arm_body import ArmBody
from samrl_core.cell.types.arm_recording import JointSignal


class Friction(Protocol):
    """Torque against the rotor's motion, linearised so that it can be integrated implicitly."""

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """(a, c) of torque a + c v' at the step's end velocity v'; c >= 0. `v` estimates v'.

        `load` is the joint's latest link-side torque [N m].
        """
        ...

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """The step has been made and ended at velocity `v`."""
        ...


class Transmission(Protocol):
    """Torque from rotor to link as a function of the twist between them."""

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """(a, c) of torque a + c rate' at the step's end twist rate; c >= 0. `rate` estimates rate'."""
        ...

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """The step has been made; `twist` is that of its beginning, `rate` that of its end."""
        ...

    def rest_twist(self, torque: float) -> float:
        """Twist that carries `torque` at rest [rad]."""
        ...


@dataclass
class Law:
    """The controller as it really is; starts as described."""

    stiffness: np.ndarray  # (J,)
    damping: np.ndarray  # (J,)
    gravity: np.ndarray  # (J,) factors of the gravity torque, one where it is compensated
    extra: list[Callable[[float, np.ndarray, np.ndarray], np.ndarray]] = field(
        default_factory=list
    )  # (t, e, de)


@dataclass
class Hooks:
    """Lists that disturbances append to; made anew for every recording. J joints, N samples."""

    body: list[Callable[[ArmBody], ArmBody]] = field(default_factory=list)
    command: list[Callable[[JointSignal], JointSignal]] = field(default_factory=list)
    law: list[Callable[[Law, float], None]] = field(default_factory=list)  # (law, t), once per period
    drive: list[Callable[[float, np.ndarray], np.ndarray]] = field(default_factory=list)  # (t, effort (J,))
    # Torque on the rotor that needs the state: (t, q, v, commanded effort), all (J,).
    rotor_torque: list[Callable[[float, np.ndarray, np.ndarray, np.ndarray], np.ndarray]] = field(
        default_factory=list
    )
    friction: dict[int, list[Friction]] = field(default_factory=dict)
    rotor_inertia: list[np.ndarray] = field(default_factory=list)  # (J,) added [kg m2]
    transmission: dict[int, Transmission] = field(default_factory=dict)
    # Torque on the links beside the sensor: (t, q, v).
    external: list[Callable[[float, np.ndarray, np.ndarray], np.ndarray]] = field(default_factory=list)
    gravity: list[Callable[[float, np.ndarray], np.ndarray]] = field(
        default_factory=list
    )  # (t, g (3,)) base axes
    mount: list[MountSpring] = field(default_factory=list)
    # (t, q, v) -> (q, v) as the encoders measure.
    encoder: list[Callable[[float, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]] = field(
        default_factory=list
    )
    # (time (N,), effort (N, J)) -> effort as the sensors measure; no controller reads them.
    sensor: list[Callable[[np.ndarray, np.ndarray], np.ndarray]] = field(default_factory=list)

    def add_friction(self, joint: int, element: Friction) -> None:
        """One more friction at a joint."""
        self.friction.setdefault(joint, []).append(element)


@dataclass(frozen=True)
class MountSpring:
    """Spring and damper of one mount joint: k x (1 + h x^2) + d x'."""

    stiffness: float  # [N m/rad or N/m]
    damping: float  # [N m s/rad or N s/m]
    hardening: float = 0.0  # [1/rad2 or 1/m2]
