"""1. Coulomb friction. T0: Fc tanh(v / ve). T1: LuGre with stiff bristles and a constant level."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import Bristles, FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    level = quantile(severity, 0.14, 1.5) * site.size  # Gaz et al. 2019 .. breakaway-informed simulations
    smooth = float(site.rng.uniform(0.002, 0.01))
    stiff = 2e4 * max(level, 1e-6)  # presliding of 0.05 mrad

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if form == "T0":
            hooks.add_friction(site.joint, FrictionCurve(lambda t, q, v, load: level * math.tanh(v / smooth)))
        else:
            hooks.add_friction(site.joint, Bristles(stiff, 0.5 * level, 0.0, lambda t, v: level))

    extra = {"ve": Quantity(smooth, "rad/s")} if form == "T0" else {"sigma0": Quantity(stiff, "N m/rad")}
    return Injection({"Fc": Quantity(level, "N m"), **extra}, attach)


DISTURBANCE = Disturbance("coulomb_friction", "joint", _make, shows_in="drive", onset=True)
