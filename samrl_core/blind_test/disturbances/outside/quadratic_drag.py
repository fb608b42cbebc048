"""Torque with the square of speed: air or splashing oil, c v |v|."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    c = quantile(severity, 2.0, 8.0) * site.size**2

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.add_friction(site.joint, FrictionCurve(lambda t, q, v, load: c * v * abs(v)))

    return Injection({"c": Quantity(c, "N m s2/rad2")}, attach)


DISTURBANCE = Disturbance("quadratic_drag", "joint", _make, shows_in="drive", outside=True)
