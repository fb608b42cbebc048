"""A cable winds up as the arm moves, and lets go.

A spring whose rest position jumps when its pull is too much.
"""

from __future__ import annotations

import math

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    most = quantile(severity, 0.6, 3.0) * site.size
    travel = 0.25 * float(site.highest[site.joint] - site.lowest[site.joint])  # until it lets go [rad]
    i = site.joint

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        state: dict[str, float] = {"free_until": -1.0}

        def pull(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            row = np.zeros_like(q)
            x = float(q[i]) - state.setdefault("rest", float(q[i]))
            if abs(x) > travel:
                state["rest"], state["free_until"] = float(q[i]), t + 0.3
                x = 0.0
            if t >= state["free_until"]:
                row[i] = -most * math.copysign((abs(x) / max(travel, 1e-6)) ** 1.5, x)
            else:
                state["rest"] = float(q[i])
            return row

        hooks.external.append(pull)

    return Injection({"most": Quantity(most, "N m"), "travel": Quantity(travel, "rad")}, attach)


DISTURBANCE = Disturbance("cable_snap", "joint", _make, shows_in="link", outside=True)
