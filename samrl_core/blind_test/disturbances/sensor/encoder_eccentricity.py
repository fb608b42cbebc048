"""22. Encoder error within the turn. T0: a sin(k q + phi). T1: a coarse grid (quantisation)."""

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
    # Below 0.2 mrad on good encoders; cheap ones reach 3 mrad (ASSUMPTION). On the motor's side of a gear the
    # error repeats many times a turn; once a turn no joint-side channel could show it.
    height = log_quantile(severity, 2e-4, 3e-3)
    wave = float(site.rng.choice([16.0, 32.0, 50.0, 80.0]))
    phase = float(site.rng.uniform(-np.pi, np.pi))
    i = site.joint

    def wavy(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, v = q.copy(), v.copy()
        angle = wave * q[i] + phase
        q[i] += height * np.sin(angle)
        v[i] *= 1.0 + height * wave * np.cos(angle)
        return q, v

    def grid(t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q = q.copy()
        if height > 0:
            q[i] = height * np.round(q[i] / height)
        return q, v

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.encoder.append(wavy if form == "T0" else grid)

    if form == "T1":
        return Injection({"step": Quantity(height, "rad")}, attach)
    named = {"a": Quantity(height, "rad"), "harmonic": Quantity(wave, "1/rad"), "phi": Quantity(phase, "rad")}
    return Injection(named, attach)


DISTURBANCE = Disturbance("encoder_eccentricity", "joint", _make, shows_in="encoder")
