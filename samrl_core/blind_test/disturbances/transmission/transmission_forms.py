"""Twist between rotor and link: springs, gaps and loops, linear in the twist rate at the step's end."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class Spring:
    """K x (1 + (x/x3)^2) + D x'."""

    stiffness: float  # [N m/rad]
    damping: float  # [N m s/rad]
    hardens_at: float = math.inf  # x3 [rad]

    def _stiffness_at(self, twist: float) -> float:
        return self.stiffness * (1.0 + 3.0 * (twist / self.hardens_at) ** 2)

    def torque(self, twist: float) -> float:
        """Without damping."""
        return self.stiffness * twist * (1.0 + (twist / self.hardens_at) ** 2)

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """As `Transmission`."""
        return self.torque(twist), self.damping + dt * self._stiffness_at(twist)

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """As `Transmission`: nothing to keep."""

    def rest_twist(self, torque: float) -> float:
        """As `Transmission`, by Newton's method."""
        twist = torque / self.stiffness
        for _ in range(20):
            twist -= (self.torque(twist) - torque) / self._stiffness_at(twist)
        return twist


@dataclass
class Gap:
    """A gap of half-width b with flanks that press as K p^n; soft gears have n > 1 (Hertz 1.5)."""

    half_width: float  # [rad]
    stiffness: float  # [N m/rad^n]
    exponent: float
    damping: float  # within the flanks [N m s/rad]
    drag: float = 0.0  # within the gap, of the grease [N m s/rad]

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """As `Transmission`, about the end of the step."""
        end = twist + dt * rate
        depth = abs(end) - self.half_width
        if depth <= 0.0:
            return 0.0, self.drag
        side = math.copysign(1.0, end)
        press = self.stiffness * depth**self.exponent
        stiffness_at = self.exponent * self.stiffness * depth ** (self.exponent - 1.0)
        # Tangent at the estimated end, so that the end's torque is met; the flank never pulls.
        damping = min(self.damping, press / max(abs(rate), 1e-9)) if rate * side < 0 else self.damping
        return side * press - stiffness_at * dt * rate, stiffness_at * dt + damping

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """As `Transmission`: nothing to keep."""

    def rest_twist(self, torque: float) -> float:
        """As `Transmission`."""
        depth = (abs(torque) / self.stiffness) ** (1.0 / self.exponent)
        return math.copysign(self.half_width + depth, torque)


@dataclass
class LoopSpring:
    """A spring with elasto-plastic sliders beside it: rate-independent loops.

    `sharp` False gives Bouc and Wen's smooth slider, z' = x' - |x'| z / zc; True one that yields at once.
    """

    stiffness: float  # [N m/rad]
    damping: float  # [N m s/rad]
    sliders: tuple[tuple[float, float], ...]  # (stiffness [N m/rad], yield [N m])
    sharp: bool

    def __post_init__(self) -> None:
        self._z = [0.0] * len(self.sliders)

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """As `Transmission`."""
        a, c = self.stiffness * twist, self.damping + dt * self.stiffness
        for (k, most), z in zip(self.sliders, self._z, strict=True):
            edge = most / max(k, 1e-12)
            if self.sharp:
                if abs(z + dt * rate) <= edge:
                    a, c = a + k * z, c + k * dt
                else:
                    a += math.copysign(most, z + dt * rate)
            else:
                den = 1.0 + dt * abs(rate) / max(edge, 1e-12)
                a, c = a + k * z / den, c + k * dt / den
        return a, c

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """As `Transmission`."""
        for i, (k, most) in enumerate(self.sliders):
            edge = most / max(k, 1e-12)
            if self.sharp:
                self._z[i] = min(max(self._z[i] + dt * rate, -edge), edge)
            else:
                self._z[i] = (self._z[i] + dt * rate) / (1.0 + dt * abs(rate) / max(edge, 1e-12))

    def rest_twist(self, torque: float) -> float:
        """As `Transmission`, sliders slack."""
        return torque / self.stiffness
