"""6. Friction that differs by direction.

T0: Gaz et al. 2019, A/(1+exp(-a(v+b))) - A/(1+exp(-a b)). T1: two levels.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    height = quantile(severity, 0.4, 2.0) * site.size
    shift = site.sign() * float(site.rng.uniform(0.015, 0.046))  # [rad/s], the identified arm's range
    steep = 40.0  # [s/rad]
    split = 1.0 / (1.0 + math.exp(-steep * shift))  # share of the height on the negative side

    def sigmoid(t: float, q: float, v: float, load: float) -> float:
        return height / (1.0 + math.exp(-min(max(steep * (v + shift), -50.0), 50.0))) - height * split

    def levels(t: float, q: float, v: float, load: float) -> float:
        return height * ((1.0 - split) if v > 0 else split) * math.tanh(v / 0.004)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.add_friction(site.joint, FrictionCurve(sigmoid if form == "T0" else levels))

    parameters = {
        "mean": Quantity(0.5 * height, "N m"),
        "difference": Quantity(height * (0.5 - split), "N m"),
    }
    if form == "T0":
        parameters |= {"A": Quantity(height, "N m"), "b": Quantity(shift, "rad/s")}
    return Injection(parameters, attach)


DISTURBANCE = Disturbance("friction_asymmetry", "joint", _make, shows_in="drive")
