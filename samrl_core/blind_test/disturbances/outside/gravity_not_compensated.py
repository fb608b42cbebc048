"""The controller leaves out part of one joint's gravity torque; the weight itself is as described."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks, Law


def _make(site: Site, form: str, severity: float) -> Injection:
    share = quantile(severity, 0.1, 1.0)
    i = site.joint

    def leave_out(law: Law, t: float) -> None:
        law.gravity = law.gravity.copy()
        law.gravity[i] *= 1.0 - share

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.law.append(leave_out)

    return Injection({"left_out": Quantity(share, "1")}, attach)


DISTURBANCE = Disturbance(
    "gravity_not_compensated", "joint", _make, shows_in="controller", first_joint=1, outside=True
)
