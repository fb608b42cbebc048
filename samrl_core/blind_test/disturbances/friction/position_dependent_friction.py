"""7. Friction that varies over the turn.

T0: harmonics of q on a level. T1: worn and tight sectors with soft edges.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import FrictionCurve
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    swing = quantile(severity, 0.15, 1.2) * site.size
    wave = float(site.rng.integers(2, 7))  # per radian: a swing within the recordings' range
    phase = float(site.rng.uniform(-math.pi, math.pi))

    def torque(t: float, q: float, v: float, load: float) -> float:
        angle = wave * q + phase
        if form == "T0":
            shape = 0.5 + 0.35 * math.sin(angle) + 0.15 * math.sin(2 * angle + 1.0)
        else:
            shape = 0.5 + 0.5 * math.tanh(6.0 * math.sin(angle))
        return swing * shape * math.tanh(v / 0.005)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.add_friction(site.joint, FrictionCurve(torque))

    parameters = {
        "swing": Quantity(swing, "N m"),
        "level": Quantity(0.5 * swing, "N m"),
        "order": Quantity(wave, "1/rad"),
        "phase": Quantity(phase, "rad"),
    }
    if form == "T0":  # of its first harmonic
        parameters["amplitude"] = Quantity(0.35 * swing, "N m")
    return Injection(parameters, attach)


DISTURBANCE = Disturbance("position_dependent_friction", "joint", _make, shows_in="drive")
