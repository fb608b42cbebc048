"""24. Payload other than nominal. T0: a mass at the tool. T1: an extended rod, off the flange's axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.arm_body import ArmBody, join_mass
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    mass = quantile(severity, 0.05, 1.0)
    reach = 0.05 if form == "T0" else float(site.rng.uniform(0.05, 0.1))
    angle = float(site.rng.uniform(-np.pi, np.pi))
    side = 0.0 if form == "T0" else float(site.rng.uniform(0.03, 0.08))
    centre = np.array([side * np.cos(angle), side * np.sin(angle), reach])
    rod = 0.0 if form == "T0" else mass * 0.3**2 / 12.0  # 30 cm long, along y
    inertia = np.diag([rod, 0.02 * rod, rod]) + 1e-4 * mass * np.eye(3)

    def add(body: ArmBody) -> ArmBody:
        last = join_mass(body.links[-1], mass, centre, inertia, body.flange_in_last)
        return replace(body, links=(*body.links[:-1], last))

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.body.append(add)

    axes = zip(("com_x", "com_y", "com_z"), centre.tolist(), strict=True)
    return Injection({"mass": Quantity(mass, "kg"), **{n: Quantity(c, "m") for n, c in axes}}, attach)


DISTURBANCE = Disturbance("payload", "arm", _make, shows_in="link")
