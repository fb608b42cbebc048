"""20. Other gains than described. T0: K and D scaled. T1: gains that depend on the size of the error."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks, Law


def _make(site: Site, form: str, severity: float) -> Injection:
    way = site.sign()
    k = way * quantile(severity, 0.03, 0.3)
    d = way * quantile(severity, 0.03, 0.3) * float(site.rng.uniform(0.5, 1.0))
    i = site.joint

    def scale(law: Law, t: float) -> None:
        law.stiffness, law.damping = law.stiffness.copy(), law.damping.copy()
        law.stiffness[i] *= 1.0 + k
        law.damping[i] *= 1.0 + d

    nominal_k, nominal_d = float(site.spec.controller.stiffness[i]), float(site.spec.controller.damping[i])

    def by_error(t: float, error: np.ndarray, rate: np.ndarray) -> np.ndarray:
        row = np.zeros_like(error)
        near = 1.0 / (1.0 + (error[i] / 0.02) ** 2)  # one at small errors
        row[i] = k * (0.6 + 0.8 * near) * nominal_k * error[i] + d * (0.6 + 0.8 * near) * nominal_d * rate[i]
        return row

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if form == "T0":
            hooks.law.append(scale)
        else:
            hooks.law.append(lambda law, t: law.extra.append(by_error))

    return Injection({"eK": Quantity(k, "1"), "eD": Quantity(d, "1")}, attach)


DISTURBANCE = Disturbance("controller_gain", "joint", _make, shows_in="controller", onset=True)
