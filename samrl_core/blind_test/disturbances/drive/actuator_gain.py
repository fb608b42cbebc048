"""14. Actuator gain: the drive gives (1+e) u. T0: e constant. T1: e falls with |u| as iron saturates."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    error = site.sign() * quantile(severity, 0.02, 0.12)
    peak = max(float(site.peak_torque[site.joint]), 1e-6)
    i = site.joint

    def drive(t: float, u: np.ndarray) -> np.ndarray:
        out = u.copy()
        share = error if form == "T0" else error * (1.3 - 0.6 * min(abs(u[i]) / peak, 1.0))
        out[i] *= 1.0 + share
        return out

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.drive.append(drive)

    return Injection({"e": Quantity(error, "1")}, attach)


DISTURBANCE = Disturbance("actuator_gain", "joint", _make, shows_in="drive", onset=True)
