"""28. A cable along the arm.

T0: spring k (q - q0) with a Dahl loop. T1: slack, then taut and hardening, with drag.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


class _Cable:
    """Torque on the links, beside the joint's sensor."""

    def __init__(self, site: Site, form: str, k: float, rest: float, loop: float) -> None:
        self._i, self._form, self._k, self._rest, self._loop = site.joint, form, k, rest, loop
        self._z, self._last = 0.0, None  # bristle's torque as a share of `loop`
        self._half = 0.25 * float(site.highest[site.joint] - site.lowest[site.joint])

    def __call__(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        at = float(q[self._i])
        step = 0.0 if self._last is None else at - self._last
        self._last = at
        # Dahl's loop, exact over a step in one direction.
        way = math.copysign(1.0, step)
        self._z = way + (self._z - way) * math.exp(-abs(step) / 0.03)
        x = at - self._rest
        if self._form == "T0":
            pull = self._k * x
        else:
            taut = max(abs(x) - 0.3 * self._half, 0.0)
            pull = math.copysign(self._k * taut * (1.0 + taut / max(self._half, 1e-6)), x)
        row = np.zeros_like(q)
        row[self._i] = -pull - self._loop * self._z
        return row


def _make(site: Site, form: str, severity: float) -> Injection:
    k = quantile(severity, 0.2, 2.5) * site.size
    middle = 0.5 * float(site.highest[site.joint] + site.lowest[site.joint])
    rest = middle + float(site.rng.uniform(-0.3, 0.3))
    loop = 0.15 * k

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.external.append(_Cable(site, form, k, rest, loop))

    return Injection(
        {"k": Quantity(k, "N m/rad"), "q0": Quantity(rest, "rad"), "h": Quantity(loop, "N m")}, attach
    )


DISTURBANCE = Disturbance("cable", "joint", _make, shows_in="link")
