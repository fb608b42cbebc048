"""16. The drive's torque changes at most so fast.

T0: slope clip. T1: slower up than down (current rise against decay).
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
)
from samrl_core.blind_test.engines.hooks import Hooks


class _RateLimit:
    """State of one recording."""

    def __init__(self, joint: int, up: float, down: float, period: float) -> None:
        self._joint, self._up, self._down, self._period = joint, up * period, down * period, period
        self._last: float | None = None

    def __call__(self, t: float, u: np.ndarray) -> np.ndarray:
        want = float(u[self._joint])
        last = want if self._last is None else self._last
        grows = abs(want) > abs(last)
        most = self._up if grows else self._down
        self._last = min(max(want, last - most), last + most)
        out = u.copy()
        out[self._joint] = self._last
        return out


def _make(site: Site, form: str, severity: float) -> Injection:
    # A described limit of 1000 N m/s is never met here; this one about what the motion asks for:
    # a little lower, and the loop would run away.
    rate = float(site.peak_rate()[site.joint]) / max(log_quantile(severity, 0.9, 1.4), 1e-6)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        down = rate if form == "T0" else 1.3 * rate
        hooks.drive.append(_RateLimit(site.joint, rate, down, site.spec.controller.period_s))

    return Injection({"R": Quantity(rate, "N m/s")}, attach)


DISTURBANCE = Disturbance("torque_rate_limit", "joint", _make, shows_in="drive")
