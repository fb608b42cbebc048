"""23. Torque sensor: (1+g) tau + b.

T1: the bias drifts as the strain gauges warm, the gain differs by direction.
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    gain = site.sign() * quantile(severity, 0.01, 0.08)
    # Biases of -.43..+.05 N m were seen on a real Panda; the tolerance at 87 N m is already .35.
    bias = site.sign() * quantile(severity, 0.01, 0.05) * float(site.spec.limits.effort[site.joint])
    i = site.joint

    def read(time: np.ndarray, effort: np.ndarray) -> np.ndarray:
        out = effort.copy()
        tau = effort[:, i]
        if form == "T0":
            out[:, i] = (1.0 + gain) * tau + bias
        else:
            warm = 1.0 - 0.5 * np.exp(-time / 6.0)
            out[:, i] = tau * (1.0 + gain * np.where(tau > 0, 1.2, 0.8)) + bias * warm
        return out

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.sensor.append(read)

    return Injection({"g": Quantity(gain, "1"), "b": Quantity(bias, "N m")}, attach)


DISTURBANCE = Disturbance("torque_sensor_error", "joint", _make, shows_in="drive", onset=True)
