"""The floor sways: the base is accelerated at a low frequency, as on a ship or a vehicle."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    most = quantile(severity, 0.15, 1.0)
    frequency = float(site.rng.uniform(0.2, 1.0))

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        phase = rng.uniform(-np.pi, np.pi, size=3)
        share = np.array([1.0, 0.7, 0.2])
        pace = 2 * np.pi * frequency * np.array([1.0, 0.83, 1.31])
        hooks.gravity.append(lambda t, g: g - most * share * np.sin(pace * t + phase))

    return Injection({"a": Quantity(most, "m/s2"), "frequency": Quantity(frequency, "Hz")}, attach)


DISTURBANCE = Disturbance("moving_platform", "arm", _make, shows_in="link", outside=True)
