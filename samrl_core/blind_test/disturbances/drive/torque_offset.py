"""54. Torque offset: the drive gives u + b. T0: b constant. T1: b grows by half while the amplifier warms."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks

WARM_S = 4.0  # time constant of the amplifier
COLD = 2.0 / 3.0  # share of the offset at a recording's start


def _make(site: Site, form: str, severity: float) -> Injection:
    offset = site.sign() * quantile(severity, 0.4, 2.0) * site.size
    i = site.joint

    def drive(t: float, u: np.ndarray) -> np.ndarray:
        out = u.copy()
        warm = 1.0 if form == "T0" else 1.0 - (1.0 - COLD) * math.exp(-t / WARM_S)
        out[i] += warm * offset
        return out

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.drive.append(drive)

    return Injection({"b": Quantity(offset, "N m")}, attach)


DISTURBANCE = Disturbance("torque_offset", "joint", _make, shows_in="drive", onset=True)
