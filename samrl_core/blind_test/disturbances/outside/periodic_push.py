"""Something pushes at the flange at its own beat: a horizontal force F max(sin, 0)^2."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    force = quantile(severity, 4.0, 20.0)
    frequency = float(site.rng.uniform(0.3, 1.2))
    way = float(site.rng.uniform(-np.pi, np.pi))
    direction = np.array([np.cos(way), np.sin(way), 0.0])

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        phase = float(rng.uniform(-np.pi, np.pi))

        def push(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            beat = max(np.sin(2 * np.pi * frequency * t + phase), 0.0) ** 2
            if beat == 0.0 or t < 0.0:
                return np.zeros_like(q)
            return site.model.jacobian(q)[:3].T @ (force * beat * direction)

        hooks.external.append(push)

    return Injection({"F": Quantity(force, "N"), "frequency": Quantity(frequency, "Hz")}, attach)


DISTURBANCE = Disturbance("periodic_push", "arm", _make, shows_in="link", outside=True)
