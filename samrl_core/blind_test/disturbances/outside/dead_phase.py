"""A motor winding drops out: torque fades at some rotor angles, only while it flickers."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    lost = quantile(severity, 0.1, 0.5)
    i = site.joint

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        starts = np.cumsum(rng.exponential(0.8, size=60) + 0.2)
        ends = starts + rng.uniform(0.05, 0.4, size=60)

        def fade(t: float, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
            row = np.zeros_like(q)
            if np.any((t >= starts) & (t < ends)):
                row[i] = -lost * u[i] * max(np.sin(50.0 * q[i]), 0.0)  # one of three windings, geared
            return row

        hooks.rotor_torque.append(fade)

    return Injection({"lost": Quantity(lost, "1")}, attach)


DISTURBANCE = Disturbance("dead_phase", "joint", _make, shows_in="drive", outside=True)
