"""The joint catches in one position: a notch that pulls towards q0 from both sides."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    most = quantile(severity, 1.0, 5.0) * site.size
    low, high = float(site.lowest[site.joint]), float(site.highest[site.joint])
    centre = low + (high - low) * float(site.rng.uniform(0.35, 0.65))
    width = float(site.rng.uniform(0.02, 0.05))
    i = site.joint

    def notch(t: float, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        row = np.zeros_like(q)
        x = (q[i] - centre) / width
        row[i] = -most * x * np.exp(0.5 - 0.5 * x * x)
        return row

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.rotor_torque.append(notch)

    named = {"most": Quantity(most, "N m"), "q0": Quantity(centre, "rad"), "width": Quantity(width, "rad")}
    return Injection(named, attach)


DISTURBANCE = Disturbance("detent", "joint", _make, shows_in="drive", outside=True)
