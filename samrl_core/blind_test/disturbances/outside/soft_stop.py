"""The arm runs into something soft at the end of its travel: a one-sided spring with damping."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    k = quantile(severity, 10.0, 60.0) * site.size**2
    low, high = float(site.lowest[site.joint]), float(site.highest[site.joint])
    way = site.sign()
    edge = 0.5 * (low + high) + way * 0.15 * (high - low)
    i = site.joint

    def stop(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        row = np.zeros_like(q)
        depth = way * (q[i] - edge)
        if depth > 0.0:
            row[i] = -way * max(k * depth * (1.0 + 0.3 * way * v[i]), 0.0)
        return row

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.external.append(stop)

    return Injection({"k": Quantity(k, "N m/rad"), "edge": Quantity(edge, "rad")}, attach)


DISTURBANCE = Disturbance("soft_stop", "joint", _make, shows_in="link", outside=True)
