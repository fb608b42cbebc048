"""13. Reflected inertia other than nominal.

T0: J more. T1: a flywheel that the rotor drags through a viscous coupling.
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
    only,
)
from samrl_core.blind_test.engines.hooks import Hooks


class _Flywheel:
    """Inertia J behind a coupling d: torque d (v - w), J w' = d (v - w)."""

    def __init__(self, inertia: float, coupling: float) -> None:
        self._inertia, self._coupling, self._speed = inertia, coupling, 0.0

    def linear(self, t: float, q: float, v: float, load: float, dt: float) -> tuple[float, float]:
        keep = self._inertia / max(self._inertia + dt * self._coupling, 1e-12)
        return -self._coupling * keep * self._speed, self._coupling * keep

    def commit(self, t: float, q: float, v: float, load: float, dt: float) -> None:
        total = max(self._inertia + dt * self._coupling, 1e-12)
        self._speed = (self._inertia * self._speed + dt * self._coupling * v) / total


def _make(site: Site, form: str, severity: float) -> Injection:
    nominal = float(site.armature[site.joint])
    more = log_quantile(severity, 0.3, 4.0) * nominal
    corner = float(site.rng.uniform(60.0, 150.0))  # d/J: above 10..24 Hz the flywheel no longer follows

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if form == "T0":
            hooks.rotor_inertia.append(only(site.joints, site.joint, more))
        else:
            hooks.add_friction(site.joint, _Flywheel(more, corner * more))

    parameters = {"Ja": Quantity(more, "kg m2")}
    if form == "T1":
        parameters["corner"] = Quantity(corner, "rad/s")
    return Injection(parameters, attach)


DISTURBANCE = Disturbance("reflected_inertia", "joint", _make, shows_in="drive")
