"""3. Stribeck: (Fs - Fc) exp(-|v/vs|^d) sgn v. T1: drop 1 / (1 + (v/vs)^2), Hess and Soom 1990."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    drop = quantile(severity, 0.15, 1.5) * site.size
    slow = float(site.rng.uniform(0.05, 0.2))
    power = float(site.rng.uniform(1.0, 2.0))
    smooth = 0.003

    def torque(t: float, q: float, v: float, load: float) -> float:
        fall = math.exp(-(abs(v / slow) ** power)) if form == "T0" else 1.0 / (1.0 + (v / slow) ** 2)
        return drop * fall * math.tanh(v / smooth)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.add_friction(site.joint, FrictionCurve(torque))

    parameters = {"drop": Quantity(drop, "N m"), "vs": Quantity(slow, "rad/s")}
    if form == "T0":
        parameters["d"] = Quantity(power, "1")
    return Injection(parameters, attach)


DISTURBANCE = Disturbance("stribeck_friction", "joint", _make, shows_in="drive")
