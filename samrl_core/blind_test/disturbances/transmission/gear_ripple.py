"""8. Torque ripple of the gear. T0: A sin(N q + phi). T1: two lines whose height grows with load."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    height = quantile(severity, 0.1, 1.0) * site.size
    lines = float(site.rng.choice([60.0, 100.0, 160.0, 200.0]))  # twice a harmonic drive's ratio of 30..100
    phase = float(site.rng.uniform(-np.pi, np.pi))
    i = site.joint

    def ripple(t: float, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        row = np.zeros_like(q)
        angle = lines * q[i] + phase
        row[i] = height * np.sin(angle)
        if form == "T1":
            load = 0.6 + 0.8 * min(abs(u[i]) / max(site.peak_torque[i], 1e-6), 1.0)
            row[i] = height * load * (0.8 * np.sin(angle) + 0.4 * np.sin(2.0 * angle + 0.7))
        return row

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.rotor_torque.append(ripple)

    parameters = {
        "amplitude": Quantity(height, "N m"),
        "order": Quantity(lines, "1/rad"),
        "phase": Quantity(phase + np.pi, "rad"),  # of the torque that is lost; the ripple is added
    }
    return Injection(parameters, attach)


DISTURBANCE = Disturbance("gear_ripple", "joint", _make, shows_in="drive")
