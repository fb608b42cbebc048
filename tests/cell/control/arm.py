"""An arm that follows perfectly, and a sender of smooth commands, for tests of the guard."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.control.guard import CommandGuard, GuardSettings
from samrl_core.cell.robots.panda.spec import PANDA
from samrl_core.cell.types.observation import ArmCommand, ArmReading

LIMITS, NAMES, HOME = PANDA.limits, PANDA.joint_names, PANDA.home
MS = 1_000_000
AHEAD_MS = 20
START_MS = 100  # of the wave; before, the sender commands rest at home
Z = np.zeros(7)


def reading(position: np.ndarray = HOME, velocity: np.ndarray = Z, stamp_ns: int = 0) -> ArmReading:
    return ArmReading(stamp_ns, position, velocity, Z)


def command(
    stamp_ms: float, position: np.ndarray = HOME, velocity: np.ndarray = Z, **fields: np.ndarray
) -> ArmCommand:
    return ArmCommand(
        round(stamp_ms * MS), position, velocity, fields.get("acceleration", Z), fields.get("effort", Z)
    )


def wave(stamp_ms: float, amplitude: float = 0.2, period_s: float = 2.0) -> ArmCommand:
    """A swing that starts at rest at home; at most 0.63 rad/s and 2 rad/s2 by default."""
    if stamp_ms <= START_MS:
        return command(stamp_ms)
    w, t = 2 * math.pi / period_s, (stamp_ms - START_MS) * 1e-3
    one = np.ones(7)
    return command(
        stamp_ms,
        HOME + amplitude * (1 - math.cos(w * t)) * one,
        amplitude * w * math.sin(w * t) * one,
        acceleration=amplitude * w * w * math.cos(w * t) * one,
        effort=one * math.sin(w * t),
    )


class Rig:
    """A guard with its two clocks and an arm that is always at the set point."""

    def __init__(self, settings: GuardSettings | None = None, pace: float = 1.0) -> None:
        self.guard = CommandGuard(LIMITS, NAMES, settings)
        self.pace = pace  # robot seconds per steady second
        self.robot_ms = 0
        self.points: list[ArmCommand] = []
        self.position, self.velocity = HOME, Z

    @property
    def robot_s(self) -> float:
        return self.robot_ms * 1e-3

    @property
    def steady_s(self) -> float:
        return 1000.0 + self.robot_s / self.pace

    def accept(self, given: ArmCommand) -> bool:
        return self.guard.accept(given, self.measured(), self.steady_s, self.robot_s)

    def measured(self) -> ArmReading:
        return reading(self.position, self.velocity, self.robot_ms * MS)

    def tick(self) -> ArmCommand:
        point = self.guard.tick(self.measured(), self.steady_s, self.robot_s)
        self.position, self.velocity = point.position, point.velocity
        self.points.append(point)
        self.robot_ms += 1
        return point

    def follow(self, milliseconds: int, send: bool = True) -> None:
        """Ticks at 1 kHz, with a command of `wave` every 4 ms."""
        for _ in range(milliseconds):
            if send and self.robot_ms % 4 == 0:
                self.accept(ahead(self.robot_ms))
            self.tick()

    def worst(self) -> tuple[float, float]:
        """Velocity and acceleration by finite differences, as shares of the limits."""
        q = np.array([p.position for p in self.points])
        dq = np.array([p.velocity for p in self.points])
        speed = np.abs(np.diff(q, axis=0)) / 1e-3 / LIMITS.velocity
        acceleration = np.abs(np.diff(dq, axis=0)) / 1e-3 / LIMITS.acceleration
        return float(speed.max()), float(acceleration.max())


def ahead(stamp_ms: float) -> ArmCommand:
    """The wave's command for a reading at `stamp_ms`, stamped ahead."""
    return wave(stamp_ms + AHEAD_MS)
