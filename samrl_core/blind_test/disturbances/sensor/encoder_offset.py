"""21. Encoder offset.

T0: q + e. T1: an offset that creeps by a third over the recording (a slipping disc).
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


def _make(site: Site, form: str, severity: float) -> Injection:
    offset = site.sign() * log_quantile(severity, 0.001, 0.04)
    i = site.joint

    def read(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q = q.copy()
        q[i] += offset * (1.0 if form == "T0" else 0.8 + 0.4 * min(max(t, 0.0) / 14.0, 1.0))
        return q, v

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.encoder.append(read)

    return Injection({"e": Quantity(offset, "rad")}, attach)


DISTURBANCE = Disturbance("encoder_offset", "joint", _make, shows_in="link", first_joint=1)
