"""What the guard allows."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import Enum

from samrl_core.common.errors import InputError


class GuardState(Enum):
    """What the guard makes the arm do."""

    HOLD = "hold"  # no command in force: stay at the set point, at first where the arm is measured
    TRACKING = "tracking"  # follow commands
    BRAKING = "braking"  # commands stopped coming: decelerate to rest, then hold
    FAULT = "fault"  # a command was refused: decelerate, hold, latched until reset
    ESTOP = "estop"  # asked for: decelerate, hold, latched until reset


@dataclass(frozen=True)
class GuardSettings:
    """Bounds beyond the arm's own limits.

    Raises:
        InputError: a bound is negative or not finite, or a fraction is not in (0, 1].
    """

    timeout_s: float = 0.1  # age of the newest command, by reception [s] (as moveit_servo's)
    start_jump_rad: float = 0.05  # farthest first command from the measured position [rad]
    tracking_jump_rad: float = 0.5  # farthest later command from the measured position [rad]
    position_margin_rad: float = 0.0  # kept from position limits [rad]
    slack: float = 1.01  # on velocity and acceleration: rounding of the generator, never a new limit
    curve_slack: float = 1.05  # on the speed of the curve between two commands: a cubic is not their source's
    stamp_resolution_s: float = (
        1e-6  # to which a commander keeps time; the curve through its points is driven [s]
    )
    max_ahead_s: float = 0.15  # farthest validity ahead of robot time at reception [s]; more: a foreign clock
    join_fraction: float = 0.2  # of velocity and acceleration limits, kept free to join the commanded curve
    join_s: float = 1.0  # longest join [s]
    rest_velocity: float = 0.02  # at rest below this [rad/s]
    brake_fraction: float = 0.5  # of the acceleration limits, used to brake

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"{field.name} is {value}, must be finite and not negative")
        for name in ("join_fraction", "brake_fraction"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InputError(f"{name} is {getattr(self, name)}, must be above 0 and at most 1")
        for name in ("slack", "curve_slack"):
            if getattr(self, name) < 1.0:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1")
        if self.timeout_s == 0.0 or self.join_s == 0.0:
            raise InputError(f"timeout_s {self.timeout_s} and join_s {self.join_s} must be above 0")


@dataclass(frozen=True)
class GuardStatus:
    """State, why, and counters since construction."""

    state: GuardState
    reason: str  # of the last stop; empty while all is well
    accepted: int
    ignored: int  # not newer than one already accepted, or received while stopped
    refused: int  # broke a rule
    late: int  # arrived after their time of validity
    since_s: float  # robot time at which the state was entered [s]
