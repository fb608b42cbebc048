"""The drive's torque wanders: a random walk, smooth at 0.2 s."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    spread = quantile(severity, 0.4, 2.0) * site.size  # after one second [N m]
    i = site.joint

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        walk = np.cumsum(rng.normal(size=400)) * spread * np.sqrt(0.2)

        def drive(t: float, u: np.ndarray) -> np.ndarray:
            out = u.copy()
            out[i] += np.interp(max(t, 0.0) / 0.2, np.arange(400), walk)
            return out

        hooks.drive.append(drive)

    return Injection({"spread_after_1s": Quantity(spread, "N m")}, attach)


DISTURBANCE = Disturbance("torque_random_walk", "joint", _make, shows_in="drive", outside=True)
