"""Eight kinds of friction, each by another law than its textbook one.

Laws of speed alone are secants F(v) / v, so that a step can be solved implicitly with a = 0. Sources:
Armstrong-Helouvry, Dupont, Canudas de Wit 1994 (survey); Hess and Soom 1990 (rational Stribeck curve);
Lampaert, Swevers, Al-Bender 2003 (generalised Maxwell slip); Herschel and Bulkley 1926 (shear-thinning
grease); Dowson 1977 (friction against load).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks
from samrl_core.blind_test.second_set.sizes import between, either_sign, friction_share, moved

_STILL = 1e-6  # [rad/s] below which a secant is taken at this speed


class SpeedFriction:
    """Friction (t, q, v, load) -> N m with the sign of v."""

    def __init__(self, law: Callable[[float, float, float, float], float]) -> None:
        """Of a law that is odd in v near rest."""
        self._law = law

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        speed = v if abs(v) > _STILL else math.copysign(_STILL, v)
        return 0.0, max(0.0, self._law(t, q, speed, load) / speed)

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`."""


class PathFriction(SpeedFriction):
    """A law whose first argument is not the time but the path travelled since the start [rad]."""

    def __init__(self, law: Callable[[float, float, float, float], float]) -> None:
        """As `SpeedFriction`."""
        super().__init__(law)
        self._path = 0.0

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        return super().linear(self._path, q, v, load, dt)

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`."""
        if t >= 0:  # the arm is held before the recording, and warms nothing
            self._path += abs(v) * dt


class IwanElements:
    """Springs in parallel that slip one after another: hysteresis before sliding, whatever the rate."""

    def __init__(self, stiffness: np.ndarray, yields: np.ndarray) -> None:
        """Of elements with a stiffness [N m/rad] and a torque at which they slip [N m]."""
        self._k = stiffness.tolist()
        self._most = (yields / stiffness).tolist()
        self._bent = [0.0] * len(self._k)

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        """As `Friction`."""
        a = c = 0.0
        for k, most, bent in zip(self._k, self._most, self._bent, strict=True):
            at = bent + v * dt
            if abs(at) < most:
                a, c = a + k * bent, c + k * dt
            else:
                a += k * math.copysign(most, at)
        return a, c

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        """As `Friction`."""
        self._bent = [min(max(b + v * dt, -m), m) for b, m in zip(self._bent, self._most, strict=True)]


def slip_elements(total_stiffness: float, total_yield: float) -> tuple[np.ndarray, np.ndarray]:
    """Six elements that slip at bends 1 : 2 : ... : 6, with equal stiffness."""
    stiffness = np.full(6, total_stiffness / 6)
    return stiffness, total_yield * np.arange(1, 7) / 21.0


def _rubbing(
    site: Site, law: Callable[[float, float, float, float], float], by_path: bool = False
) -> Callable[[Hooks, np.random.Generator], None]:
    kind = PathFriction if by_path else SpeedFriction
    return lambda hooks, rng: hooks.add_friction(site.joint, kind(law))


def _coulomb(site: Site, form: str, severity: float) -> Injection:
    """Arctangent instead of a hyperbolic one: it nears its level as 1 / v."""
    level, width = quantile(severity, 0.14, 1.5) * friction_share(site), between(site, 0.003, 0.012)

    def law(t: float, q: float, v: float, load: float) -> float:
        return level * 2.0 / math.pi * math.atan(v / width)

    parameters = {"Fc": Quantity(level, "N m"), "width": Quantity(width, "rad/s")}
    return Injection(parameters, _rubbing(site, law))


def _viscous(site: Site, form: str, severity: float) -> Injection:
    """Shear-thinning grease: F = Fv v1 (|v| / v1)^n, which is Fv at the speed v1."""
    share = float(site.spec.limits.effort[site.joint]) / 87.0
    at, power = 0.5, between(site, 0.8, 0.95)
    gradient = quantile(severity, 0.1, 2.0) * share

    def law(t: float, q: float, v: float, load: float) -> float:
        return math.copysign(gradient * at * (abs(v) / at) ** power, v)

    parameters = {"Fv": Quantity(gradient, "N m s/rad"), "exponent": Quantity(power, "1")}
    return Injection(parameters, _rubbing(site, law))


def _stribeck(site: Site, form: str, severity: float) -> Injection:
    """Hess and Soom: drop / (1 + (v / vs)^2)."""
    drop, vs = quantile(severity, 0.15, 1.5) * friction_share(site), between(site, 0.05, 0.2)

    def law(t: float, q: float, v: float, load: float) -> float:
        return drop * math.tanh(v / 0.004) / (1.0 + (v / vs) ** 2)

    return Injection({"drop": Quantity(drop, "N m"), "vs": Quantity(vs, "rad/s")}, _rubbing(site, law))


def _load_dependent(site: Site, form: str, severity: float) -> Injection:
    """Less than proportional, as of elastic contacts: friction ~ load^0.85; more where the load drives."""
    share, back = quantile(severity, 0.02, 0.25), between(site, 1.0, 1.3)
    usual = max(0.5 * float(site.peak_torque[site.joint]), 0.1)  # the load at which the share is exact [N m]

    def law(t: float, q: float, v: float, load: float) -> float:
        level = share * usual * (abs(load) / usual) ** 0.85
        return level * (back if load * v < 0 else 1.0) * math.tanh(v / 0.005)

    parameters = {"Kl": Quantity(share, "1"), "usual_load": Quantity(usual, "N m")}
    return Injection(parameters, _rubbing(site, law))


def _presliding(site: Site, form: str, severity: float) -> Injection:
    """Generalised Maxwell slip: no state equation, six springs that slip one after another."""
    level = quantile(severity, 0.3, 1.5) * friction_share(site)
    stiffness = level / between(site, 0.002, 0.006)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if level > 0:
            hooks.add_friction(site.joint, IwanElements(*slip_elements(stiffness, level)))

    parameters = {"Fc": Quantity(level, "N m"), "sigma0": Quantity(stiffness, "N m/rad")}
    return Injection(parameters, attach)


def _asymmetry(site: Site, form: str, severity: float) -> Injection:
    """Two levels, one for each direction."""
    mean = quantile(severity, 0.2, 1.0) * friction_share(site)
    unequal = either_sign(site) * between(site, 0.4, 0.7)
    forward, backward = mean * (1 + unequal), mean * (1 - unequal)

    def law(t: float, q: float, v: float, load: float) -> float:
        return (forward if v > 0 else backward) * math.tanh(v / 0.006)

    parameters = {
        "mean": Quantity(mean, "N m"),
        "forward": Quantity(forward, "N m"),
        "backward": Quantity(backward, "N m"),
    }
    return Injection(parameters, _rubbing(site, law))


def _position_dependent(site: Site, form: str, severity: float) -> Injection:
    """A tight spot in each of N sectors of a turn (von Mises bumps), above a level everywhere."""
    bump = quantile(severity, 0.15, 1.2) * friction_share(site)
    sectors, sharp = int(site.rng.integers(3, 8)), between(site, 1.0, 2.5)
    middle, half = moved(site)
    spot = middle + between(site, -0.5, 0.5) * half

    def law(t: float, q: float, v: float, load: float) -> float:
        height = math.exp(sharp * (math.cos(sectors * (q - spot)) - 1.0))
        return bump * (0.2 + height) * math.tanh(v / 0.005)

    parameters = {
        "bump": Quantity(bump, "N m"),
        "order": Quantity(float(sectors), "1/rad"),
        "spot": Quantity(spot, "rad"),
    }
    return Injection(parameters, _rubbing(site, law))


def _thermal(site: Site, form: str, severity: float) -> Injection:
    """Warmed by the way travelled, not by time: a joint that rests stays stiff."""
    share = friction_share(site)
    cold, warm = quantile(severity, 0.3, 1.9) * share, quantile(severity, 0.1, 0.4) * share
    seconds, pace = between(site, 2.5, 5.0), 0.25  # of moving at `pace` [rad/s]

    def law(path: float, q: float, v: float, load: float) -> float:
        level = warm + (cold - warm) * math.exp(-path / (seconds * pace))
        return level * math.tanh(v / 0.005)

    parameters = {
        "F0": Quantity(cold, "N m"),
        "Finf": Quantity(warm, "N m"),
        "path": Quantity(seconds * pace, "rad"),
    }
    return Injection(parameters, _rubbing(site, law, by_path=True))


FAMILIES = (
    Disturbance("coulomb_friction", "joint", _coulomb, "drive", onset=True),
    Disturbance("viscous_friction", "joint", _viscous, "drive", onset=True),
    Disturbance("stribeck_friction", "joint", _stribeck, "drive"),
    Disturbance("load_dependent_friction", "joint", _load_dependent, "drive"),
    Disturbance("presliding", "joint", _presliding, "drive"),
    Disturbance("friction_asymmetry", "joint", _asymmetry, "drive"),
    Disturbance("position_dependent_friction", "joint", _position_dependent, "drive"),
    Disturbance("thermal_friction", "joint", _thermal, "drive"),
)
