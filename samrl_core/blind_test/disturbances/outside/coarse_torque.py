"""The drive takes torque in coarse steps and rounds towards zero."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    step = quantile(severity, 0.5, 4.0) * site.size
    i = site.joint

    def drive(t: float, u: np.ndarray) -> np.ndarray:
        out = u.copy()
        if step > 0:
            out[i] = step * np.trunc(u[i] / step)
        return out

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.drive.append(drive)

    return Injection({"step": Quantity(step, "N m")}, attach)


DISTURBANCE = Disturbance("coarse_torque", "joint", _make, shows_in="drive", outside=True)
