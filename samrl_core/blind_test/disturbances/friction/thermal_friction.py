"""9. Friction that falls as the drive warms.

T0: Finf + (F0 - Finf) exp(-t/T). T1: heat from the friction itself.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


class _Heated:
    """Friction level that a temperature of first order lowers; the heat is the friction's own work."""

    def __init__(self, cold: float, warm: float, time_constant: float) -> None:
        self._cold, self._warm, self._tau = cold, warm, time_constant
        self._heat = 0.0  # 0 cold .. 1 warm

    def _level(self) -> float:
        return self._warm + (self._cold - self._warm) * math.exp(-2.0 * self._heat)

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        speed = max(abs(v), 1e-6)
        return 0.0, self._level() * math.tanh(speed / 0.005) / speed

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        if t > 0.0:  # cold when the recording begins
            self._heat += dt / self._tau * (abs(v) / 0.15 - self._heat)  # warm at 0.15 rad/s on average


def _make(site: Site, form: str, severity: float) -> Injection:
    warm = quantile(severity, 0.1, 0.4) * site.size
    cold = warm + quantile(severity, 0.2, 1.5) * site.size
    # Minutes in real drives; recordings here last seconds, so the drive is a small one (ASSUMPTION).
    constant = float(site.rng.uniform(3.0, 8.0))

    def torque(t: float, q: float, v: float, load: float) -> float:
        level = warm + (cold - warm) * math.exp(-max(t, 0.0) / constant)
        return level * math.tanh(v / 0.005)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.add_friction(
            site.joint, FrictionCurve(torque) if form == "T0" else _Heated(cold, warm, constant)
        )

    return Injection(
        {"F0": Quantity(cold, "N m"), "Finf": Quantity(warm, "N m"), "T": Quantity(constant, "s")}, attach
    )


DISTURBANCE = Disturbance("thermal_friction", "joint", _make, shows_in="drive")
