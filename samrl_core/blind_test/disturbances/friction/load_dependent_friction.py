"""4. Friction that grows with load. T0: Kl |load| sgn v. T1: gear losses, larger when the load drives."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    share = quantile(severity, 0.02, 0.25)  # BAM: 0..0.5 for geared servos, less for such arms (ASSUMPTION)
    back = 1.8 if form == "T1" else 1.0  # loss with the load driving, against the motor driving (ASSUMPTION)

    def torque(t: float, q: float, v: float, load: float) -> float:
        driven = 0.5 * (1.0 - math.tanh(load * v / 0.05))  # one where the load drives
        factor = 1.0 + (back - 1.0) * driven
        return share * factor * abs(load) * math.tanh(v / 0.005)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.add_friction(site.joint, FrictionCurve(torque))

    return Injection({"Kl": Quantity(share, "1"), "Kb": Quantity(share * back, "1")}, attach)


DISTURBANCE = Disturbance("load_dependent_friction", "joint", _make, shows_in="drive")
