"""15. The drive gives less than its stated limit. T0: clip. T1: soft knee, u / (1 + |u/L|^p)^(1/p)."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    i = site.joint
    floor, peak = float(site.gravity_torque[i]), float(site.peak_torque[i])
    # Between what motion asks for and what gravity alone asks for: lower and the arm would sink.
    limit = floor + (peak - floor) * (1.0 - quantile(severity, 0.1, 0.85))
    # A real arm may weigh and rub more than the nominal one: background at twice its tolerances (masses and
    # centres 4 %, offset 0.8 % of the effort limit) let the fourth Rizon joint sink a radian without this.
    limit = max(limit, 1.04 * floor + 0.008 * float(site.spec.limits.effort[i]))
    if severity == 0.0:
        limit = 10.0 * peak
    power = 12.0

    def drive(t: float, u: np.ndarray) -> np.ndarray:
        out = u.copy()
        if form == "T0":
            out[i] = min(max(u[i], -limit), limit)
        else:
            knee = 1.15 * limit  # so that little is lost where T0 loses nothing
            out[i] = u[i] / (1.0 + abs(u[i] / knee) ** power) ** (1.0 / power)
        return out

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.drive.append(drive)

    return Injection({"L": Quantity(limit, "N m")}, attach)


DISTURBANCE = Disturbance("torque_saturation", "joint", _make, shows_in="drive")
