"""19. Late or lost packets: the drives hold their last effort.

T0: independent losses. T1: bursts (Gilbert 1960).
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
    quantile,
)
from samrl_core.blind_test.engines.hooks import Hooks


def _holds(form: str, share: float, longest: int, rng: np.random.Generator) -> np.ndarray:
    """Whether each of 40 000 ticks goes without a new packet."""
    lost = np.zeros(40_000, dtype=bool)
    if share <= 0:
        return lost
    # Bad and good spells of a quarter second on average; all losses fall into the bad ones.
    bad = np.cumsum(rng.random(len(lost)) < 0.004) % 2 == 0
    mean = 0.5 * (1 + longest)
    at = 0
    while at < len(lost):
        rate = share if form == "T0" else min(2.0 * share, 0.6)
        at += 1 + int(rng.exponential(mean * (1.0 - rate) / rate))
        held = int(rng.integers(1, longest + 1))
        if form == "T0" or (at < len(lost) and bad[at]):
            lost[at : at + held] = True
        at += held
    return lost


class _Hold:
    """The drives' last effort."""

    def __init__(self, lost: np.ndarray, period: float) -> None:
        self._lost, self._period = lost, period
        self._last: np.ndarray | None = None

    def __call__(self, t: float, u: np.ndarray) -> np.ndarray:
        if self._last is None or not self._lost[round(t / self._period) % len(self._lost)]:
            self._last = u
        return self._last


def _make(site: Site, form: str, severity: float) -> Injection:
    share = log_quantile(severity, 0.014, 0.25)  # 1.4-1.7 % late on a real Panda, and worse networks
    longest = max(1, round(quantile(severity, 6, 20)))  # [ticks]; 6.2 ms seen

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.drive.append(_Hold(_holds(form, share, longest, rng), site.spec.controller.period_s))

    period = site.spec.controller.period_s
    return Injection({"held": Quantity(share, "1"), "longest": Quantity(longest * period, "s")}, attach)


DISTURBANCE = Disturbance("packet_jitter", "arm", _make, shows_in="drive")
