"""Settings of the simulated worlds."""

from __future__ import annotations

from dataclasses import dataclass, field

from samrl_core.cell.world.sensor_noise import NO_JOINT_NOISE, NO_RGBD_NOISE, JointSensorNoise, RgbdNoise
from samrl_core.common.errors import InputError


@dataclass(frozen=True)
class WorldSettings:
    """What a simulated world needs beside the cell and the task.

    Raises:
        InputError: the period is not a whole number of nanoseconds above zero.
    """

    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)  # in world [m/s2]
    solver_iterations: int = 50
    contact_stiffness: float = 5e4  # per contact point, ASSUMPTION: a peg held by rubber pads [N/m]
    contact_damping: float = 200.0  # per contact point, ASSUMPTION: half critical for 0.8 kg [N s/m]
    joint_friction: float = 0.0  # Coulomb's, in the tool arm's joints, share of their effort limits [-]
    light_direction: tuple[float, float, float] = (0.6, 0.4, 1.2)  # towards the light, in world
    shadow: bool = False
    joint_noise: JointSensorNoise = field(default_factory=JointSensorNoise)
    rgbd_noise: RgbdNoise = field(default_factory=RgbdNoise)

    def __post_init__(self) -> None:
        if self.solver_iterations < 1:
            raise InputError(f"solver_iterations is {self.solver_iterations}, must be at least 1")
        if not (self.contact_stiffness > 0 and self.contact_damping > 0):
            raise InputError(
                f"contact stiffness {self.contact_stiffness} N/m and damping {self.contact_damping} N s/m "
                f"must be positive"
            )
        if not 0.0 <= self.joint_friction < 1.0:
            raise InputError(f"joint_friction is {self.joint_friction}, must be at least 0 and below 1")


NOISELESS = WorldSettings(joint_noise=NO_JOINT_NOISE, rgbd_noise=NO_RGBD_NOISE)
