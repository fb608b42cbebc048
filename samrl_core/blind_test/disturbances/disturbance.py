"""What every disturbance is: a family at a place, in a functional form, with parameters and where it acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import RobotSpec
from samrl_core.common.errors import InputError

_NEUTRAL = 0.05  # below this quantile a range is left towards "no effect", reached at zero


@dataclass(frozen=True)
class Quantity:
    """A parameter's value and unit."""

    value: float | str
    unit: str


@dataclass(frozen=True, eq=False)
class Site:
    """The arm that is disturbed, and where. Arrays (J,)."""

    spec: RobotSpec
    role: str
    model: ArmModel  # nominal, with tool
    joint: int  # index of the disturbed joint; the link it moves
    armature: np.ndarray  # nominal rotor inertia [kg m2]
    peak_torque: np.ndarray  # of the nominal arm over its recordings [N m]
    gravity_torque: np.ndarray  # largest of gravity alone over its recordings [N m]
    peak_rate: Callable[[], np.ndarray]  # of the commanded torque; worked out when asked for [N m/s]
    lowest: np.ndarray  # reached by the recordings' commands [rad]
    highest: np.ndarray
    rng: np.random.Generator  # for what severity does not fix: signs, phases, directions

    @property
    def size(self) -> float:
        """Root of the drive's strength against a Panda's shoulder: friction grows slower."""
        return float(np.sqrt(self.spec.limits.effort[self.joint] / 87.0))

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.spec.joint_names)

    def sign(self) -> float:
        """Plus or minus one, sampled."""
        return 1.0 if self.rng.random() < 0.5 else -1.0


Attach = Callable[[Hooks, np.random.Generator], None]


@dataclass(frozen=True, eq=False)
class Injection:
    """What a disturbance makes of a severity: parameters for the label, and how to act in one recording.

    A parameter that the diagnosis reports too has the name and the unit that it has there.
    `attach` adds fresh state to a recording's hooks; its generator is that of the recording.
    """

    parameters: dict[str, Quantity]
    attach: Attach


@dataclass(frozen=True)
class Disturbance:
    """A family that can be injected. `make(site, form, severity)`: severity 0 is no effect at all."""

    name: str
    place: str  # `joint`, `arm` or `link`
    make: Callable[[Site, str, float], Injection]
    # Channel that it shows in first, as differences from the nominal run.
    # controller: commanded effort against the law at the measured state; drive: effort against commanded
    # effort; link: effort against inverse dynamics of the measured motion; encoder: position and velocity.
    shows_in: str  # one of these, or `either` for controller or drive
    outside: bool = False  # not in the catalogue: form T2
    onset: bool = False  # may be switched on within a recording
    twists: bool = False  # needs the transmission of its joint for itself
    also_arm: bool = False  # a joint effect that may also hold for all joints
    needs_reversal: bool = False  # only where the nominal load changes its sign: else nothing moves
    first_joint: int = 0  # joints before it cannot show the effect: gravity does not act on a vertical axis


def quantile(severity: float, low: float, high: float) -> float:
    """The value at a quantile of [low, high]; below 0.05 it runs to zero.

    Raises:
        InputError: severity outside 0..1.
    """
    if not 0.0 <= severity <= 1.0:
        raise InputError(f"severity {severity} is no quantile; give one of 0..1")
    at = low + (high - low) * max(severity, _NEUTRAL)
    return at * min(1.0, severity / _NEUTRAL)


def log_quantile(severity: float, low: float, high: float) -> float:
    """As `quantile`, evenly in the logarithm."""
    at = low * (high / low) ** max(severity, _NEUTRAL)
    return at * min(1.0, quantile(severity, 1.0, 1.0))


def only(joints: int, joint: int, value: float) -> np.ndarray:
    """Zeros (joints,) but for one."""
    row = np.zeros(joints)
    row[joint] = value
    return row
