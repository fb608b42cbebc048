"""What the guard allows."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class GuardState(Enum):
    """What the guard makes the arm do."""

    HOLD = "hold"  # no command in force: stay where the arm is
    TRACKING = "tracking"  # follow commands
    BRAKING = "braking"  # commands stopped coming: decelerate to rest; a fresh command resumes
    FAULT = "fault"  # a command was refused: decelerate, hold, latched until reset
    ESTOP = "estop"  # asked for: decelerate, hold, latched until reset


@dataclass(frozen=True)
class GuardSettings:
    """Bounds beyond the arm's own limits."""

    timeout_s: float = 0.1  # age of the newest command, by reception [s] (as moveit_servo's)
    start_jump_rad: float = 0.05  # farthest first command from the measured position [rad]
    tracking_jump_rad: float = 0.5  # farthest later command from the measured position [rad]
    position_margin_rad: float = 0.0  # kept from position limits [rad]
    slack: float = 1.01  # on velocity and acceleration: rounding of the generator, never a new limit
    rest_velocity: float = 0.02  # at rest below this [rad/s]
    brake_fraction: float = 0.5  # of the acceleration limits, used to brake


@dataclass(frozen=True)
class GuardStatus:
    """State, and why."""

    state: GuardState
    reason: str  # empty while all is well
    accepted: int
    ignored: int  # older than one already accepted
    refused: int
