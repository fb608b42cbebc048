"""A drive leaks: a share of the next joint's torque command reaches this one, through a slow path."""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    i = site.joint
    other = i + 1 if i + 1 < site.joints else i - 1
    # Of the effort limit, or of what the joint's servo holds within a radian: the last Rizon joint is so soft
    # (10 N m/rad at 39 N m) that a fifth of its limit turned it away by more than that.
    strength = min(float(site.spec.limits.effort[i]), 1.0 * float(site.spec.controller.stiffness[i]))
    most = quantile(severity, 0.03, 0.2) * strength
    share = site.sign() * most / max(float(site.peak_torque[other]), 1.0)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        state = {"slow": None}

        def drive(t: float, u: np.ndarray) -> np.ndarray:
            slow = u[other] if state["slow"] is None else state["slow"]
            state["slow"] = slow + 0.02 * (u[other] - slow)  # 50 ms at 1 kHz
            out = u.copy()
            out[i] += share * state["slow"]
            return out

        hooks.drive.append(drive)

    name = site.spec.joint_names[other]
    return Injection({"share": Quantity(share, "1"), "from": Quantity(name, "joint")}, attach)


DISTURBANCE = Disturbance("neighbour_coupling", "joint", _make, shows_in="drive", outside=True)
