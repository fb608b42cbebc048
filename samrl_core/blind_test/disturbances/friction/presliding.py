"""5. Presliding: friction as a spring before it slips.

T0: LuGre, soft bristles. T1: four Maxwell-slip elements.
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.friction.friction_forms import Bristles, Slider
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    level = quantile(severity, 0.3, 1.5) * site.size
    reach = float(site.rng.uniform(2e-3, 1e-2))  # twist until it slips [rad]: s0 of 30..750 N m/rad
    stiff = level / reach

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if form == "T0":
            hooks.add_friction(site.joint, Bristles(stiff, 0.003 * stiff, 0.0, lambda t, v: level))
            return
        for k in (1, 2, 3, 4):  # equal yields at rising twists: a rounded, rate-independent loop
            hooks.add_friction(site.joint, Slider(level / 4 / (reach * k / 2.5), level / 4))

    return Injection({"Fc": Quantity(level, "N m"), "sigma0": Quantity(stiff, "N m/rad")}, attach)


DISTURBANCE = Disturbance("presliding", "joint", _make, shows_in="drive")
