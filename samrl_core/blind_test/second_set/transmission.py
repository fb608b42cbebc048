"""Backlash, elasticity and hysteresis between rotor and link, none of them piecewise linear.

Sources: Hunt and Crossley 1975 (contact force ~ depth^1.5); Tuttle and Seering 1996 (harmonic drives
stiffen with twist); Ruderman, Hoffmann, Bertram 2009 (hysteresis of elastic joints by slip elements).
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
    quantile,
)
from samrl_core.blind_test.engines.hooks import Hooks, Transmission
from samrl_core.blind_test.second_set.friction import slip_elements
from samrl_core.blind_test.second_set.sizes import between, drive_share


class HertzFlanks:
    """Torque = k (|twist| - b)^1.5 beyond a half width b, nothing within it, and grease all through."""

    def __init__(self, half_width: float, flank: float, grease: float) -> None:
        """Of b [rad], k [N m/rad^1.5] and a damping [N m s/rad]."""
        self._b, self._k, self._d = half_width, flank, grease

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """As `Transmission`; about the end of the step that is expected."""
        at = twist + rate * dt
        depth = max(abs(at) - self._b, 0.0)
        torque = math.copysign(self._k * depth**1.5, at)
        gradient = 1.5 * self._k * math.sqrt(depth) * dt
        return torque - gradient * rate, gradient + self._d

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """As `Transmission`."""

    def rest_twist(self, torque: float) -> float:
        """As `Transmission`."""
        return math.copysign(self._b + (abs(torque) / self._k) ** (2.0 / 3.0), torque)


class DuffingSpring:
    """Torque = K x (1 + h (x / x0)^2) + D x'."""

    def __init__(self, stiffness: float, damping: float, hardening: float, usual_twist: float) -> None:
        """Of K [N m/rad], D [N m s/rad], h and x0 [rad]."""
        self._k, self._d, self._cubic = stiffness, damping, hardening / usual_twist**2

    def _torque(self, twist: float) -> float:
        return self._k * twist * (1.0 + self._cubic * twist * twist)

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """As `Transmission`."""
        gradient = self._k * (1.0 + 3.0 * self._cubic * twist * twist) * dt
        return self._torque(twist), gradient + self._d

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """As `Transmission`."""

    def rest_twist(self, torque: float) -> float:
        """As `Transmission`, by Newton's method."""
        x = torque / self._k
        for _ in range(30):
            x -= (self._torque(x) - torque) / (self._k * (1.0 + 3.0 * self._cubic * x * x))
        return x


class SlippingSpring:
    """A spring with six slip elements beside it."""

    def __init__(self, stiffness: float, damping: float, slip_stiffness: float, loop: float) -> None:
        """Of K and the elements' stiffness in all [N m/rad], D [N m s/rad] and their torque in all [N m]."""
        ks, yields = slip_elements(slip_stiffness, loop)
        self._k, self._d = stiffness, damping
        self._ks, self._most = ks.tolist(), (yields / ks).tolist()
        self._bent = [0.0] * 6

    def linear(self, t: float, twist: float, rate: float, dt: float) -> tuple[float, float]:
        """As `Transmission`."""
        a, c = self._k * twist, self._k * dt + self._d
        for k, most, bent in zip(self._ks, self._most, self._bent, strict=True):
            at = bent + rate * dt
            if abs(at) < most:
                a, c = a + k * bent, c + k * dt
            else:
                a += k * math.copysign(most, at)
        return a, c

    def commit(self, t: float, twist: float, rate: float, dt: float) -> None:
        """As `Transmission`."""
        self._bent = [min(max(b + rate * dt, -m), m) for b, m in zip(self._bent, self._most, strict=True)]

    def rest_twist(self, torque: float) -> float:
        """As `Transmission`; the slip elements start without torque."""
        return torque / self._k


def _damping(site: Site, stiffness: float, ratio: float) -> float:
    """Of a rotor on a spring, at a share of critical damping."""
    return 2.0 * ratio * math.sqrt(stiffness * float(site.armature[site.joint]))


def _into(site: Site, parameters: dict[str, Quantity], made: type, *values: float) -> Injection:
    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        element: Transmission = made(*values)
        hooks.transmission[site.joint] = element

    return Injection(parameters, attach)


def _backlash(site: Site, form: str, severity: float) -> Injection:
    """Play between flanks that harden as bodies in contact do; grease damps within the play."""
    half_width = log_quantile(severity, 0.0003, 0.010)
    peak = max(float(site.peak_torque[site.joint]), 0.2)
    flank = peak / (3e-4 if severity > 0 else 1e-5) ** 1.5
    grease = _damping(site, peak / 3e-4, 0.01)
    parameters = {"b": Quantity(half_width, "rad"), "flank": Quantity(flank, "N m/rad^1.5")}
    return _into(site, parameters, HertzFlanks, half_width, flank, grease)


def _elasticity(site: Site, form: str, severity: float) -> Injection:
    """A spring that is half again as stiff at the recordings' largest torque."""
    stiffness = 1e8 if severity == 0 else 20000.0 * 0.1**severity * drive_share(site)
    usual = max(float(site.peak_torque[site.joint]), 0.2) / stiffness
    hardening, damping = between(site, 0.3, 0.6), _damping(site, stiffness, between(site, 0.01, 0.04))
    parameters = {
        "K": Quantity(stiffness, "N m/rad"),
        "D": Quantity(damping, "N m s/rad"),
        "hardening": Quantity(hardening, "1"),
    }
    return _into(site, parameters, DuffingSpring, stiffness, damping, hardening, usual)


def _hysteresis(site: Site, form: str, severity: float) -> Injection:
    """Slip elements beside a spring: a loop of a stated height, whatever the rate."""
    stiffness = 1e8 if severity == 0 else 3000.0 * drive_share(site)
    loop = quantile(severity, 0.6, 4.0) * drive_share(site)
    slip = stiffness * between(site, 1.0, 2.0)
    damping = _damping(site, stiffness + slip, 0.02)
    parameters = {"loop_torque": Quantity(loop, "N m"), "K": Quantity(stiffness, "N m/rad")}
    return _into(site, parameters, SlippingSpring, stiffness, damping, slip, max(loop, 1e-9))


FAMILIES = (
    Disturbance("backlash", "joint", _backlash, "drive", twists=True, needs_reversal=True),
    Disturbance("joint_elasticity", "joint", _elasticity, "drive", twists=True),
    Disturbance("transmission_hysteresis", "joint", _hysteresis, "drive", twists=True),
)
