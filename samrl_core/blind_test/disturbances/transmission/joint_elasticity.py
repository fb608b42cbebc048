"""11. Joint elasticity: rotor and link as two masses, encoder on the rotor.

T0: linear. T1: hardening (cubic).
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
)
from samrl_core.blind_test.disturbances.transmission.transmission_forms import Spring
from samrl_core.blind_test.engines.hooks import Hooks

_RIGID = 1e-8  # compliance of a joint that shows none [rad/(N m)]


def _make(site: Site, form: str, severity: float) -> Injection:
    # 2e4 .. 2e3 N m/rad at a Panda's shoulder (recalled: 5e3..2e4 for harmonic drives, less for belts).
    compliance = _RIGID + log_quantile(severity, 5e-5, 5e-4) / site.size**2
    stiff = 1.0 / compliance
    damping = 0.02 * math.sqrt(stiff * float(site.armature[site.joint]))
    knee = float(site.peak_torque[site.joint]) / stiff  # twist at which the hardening doubles the torque

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        spring = Spring(stiff, damping) if form == "T0" else Spring(stiff, damping, max(knee, 1e-9))
        hooks.transmission[site.joint] = spring

    parameters = {"K": Quantity(stiff, "N m/rad"), "D": Quantity(damping, "N m s/rad")}
    if form == "T1":
        parameters["hardens_at"] = Quantity(knee, "rad")
    return Injection(parameters, attach)


DISTURBANCE = Disturbance("joint_elasticity", "joint", _make, shows_in="drive", twists=True)
