"""2. Viscous friction. T0: Fv v. T1: grease that thins with speed, Fv vr asinh(v / vr)."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    drag = quantile(severity, 0.1, 2.0) * site.size**2
    knee = float(site.rng.uniform(0.5, 1.0))

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if form == "T0":
            hooks.add_friction(site.joint, FrictionCurve(lambda t, q, v, load: drag * v))
        else:
            hooks.add_friction(
                site.joint, FrictionCurve(lambda t, q, v, load: drag * knee * math.asinh(v / knee))
            )

    extra = {} if form == "T0" else {"knee": Quantity(knee, "rad/s")}
    return Injection({"Fv": Quantity(drag, "N m s/rad"), **extra}, attach)


DISTURBANCE = Disturbance("viscous_friction", "joint", _make, shows_in="drive", onset=True)
