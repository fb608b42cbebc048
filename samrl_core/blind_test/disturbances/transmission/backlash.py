"""10. Backlash.

T0: a gap between stiff linear flanks. T1: Hertz flanks, grease in the gap: a hysteretic gear.
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
)
from samrl_core.blind_test.disturbances.transmission.transmission_forms import Gap
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    half = log_quantile(severity, 3e-4, 1e-2)  # harmonic drives below 0.5 mrad, other gears to 20 mrad
    stiff = 3e4 * site.size**2 * (1.0 if severity > 0 else 50.0)  # [N m/rad]
    rotor = float(site.armature[site.joint])

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        damping = 0.3 * np.sqrt(stiff * rotor)
        if form == "T0":
            hooks.transmission[site.joint] = Gap(half, stiff, 1.0, damping)
        else:  # as stiff as T0 under 0.3 mrad of pressing
            hooks.transmission[site.joint] = Gap(half, stiff / 3e-4**0.5, 1.5, damping, 0.05 * site.size**2)

    return Injection({"b": Quantity(half, "rad"), "flank_stiffness": Quantity(stiff, "N m/rad")}, attach)


DISTURBANCE = Disturbance("backlash", "joint", _make, shows_in="drive", needs_reversal=True, twists=True)
