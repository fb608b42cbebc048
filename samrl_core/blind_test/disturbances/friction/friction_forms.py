"""Friction elements that several families share, each linear in the velocity at the step's end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from samrl_core.blind_test.engines.hooks import Friction

_SLOWEST = 1e-6  # [rad/s], below which a curve is taken as straight


@dataclass
class FrictionCurve:
    """Torque F(t, q, v, load) of the velocity's sign, zero at rest, by its secant through the origin."""

    torque: Callable[[float, float, float, float], float]

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        speed = math.copysign(max(abs(v), _SLOWEST), v)
        return 0.0, max(self.torque(t, q, speed, load) / speed, 0.0)

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`: nothing to keep."""


@dataclass
class Bristles:
    """LuGre (Canudas de Wit et al. 1995): z' = v - s0 |v| z / g(v), torque s0 z + s1 z' + s2 v.

    With constant g, s1 = s2 = 0, this is Dahl's model (1968) with exponent one.
    """

    s0: float  # [N m/rad]
    s1: float  # [N m s/rad]
    s2: float  # [N m s/rad]
    level: Callable[[float, float], float]  # g(t, v) [N m]
    z: float = 0.0  # [rad]

    def _next(self, t: float, v: float, dt: float) -> tuple[float, float]:
        # z' implicit in z and in v: z+ = (z + dt v+) / den
        den = 1.0 + dt * self.s0 * abs(v) / max(self.level(t, v), 1e-9)
        return self.z / den, dt / den

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        z0, z1 = self._next(t, v, dt)
        damp = self.s1 / dt
        return self.s0 * z0 + damp * (z0 - self.z), (self.s0 + damp) * z1 + self.s2

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`."""
        z0, z1 = self._next(t, v, dt)
        self.z = z0 + z1 * v


@dataclass
class Slider:
    """A spring that slips at a yield torque: one element of a generalised Maxwell-slip model."""

    stiffness: float  # [N m/rad]
    yields: float  # [N m]
    z: float = 0.0  # [rad]

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        torque = self.stiffness * (self.z + dt * v)
        if abs(torque) <= self.yields:
            return self.stiffness * self.z, self.stiffness * dt
        return math.copysign(self.yields, torque), 0.0

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`."""
        edge = self.yields / max(self.stiffness, 1e-12)
        self.z = min(max(self.z + dt * v, -edge), edge)


@dataclass
class Gated:
    """A friction that begins at `onset` [s]."""

    inner: Friction
    onset: float

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        return self.inner.linear(t, q, v, load, dt) if t >= self.onset else (0.0, 0.0)

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`."""
        if t >= self.onset:
            self.inner.commit(t, q, v, load, dt)
