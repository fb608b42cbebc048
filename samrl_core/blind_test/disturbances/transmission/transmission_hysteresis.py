"""12. Transmission hysteresis: loops of twist over torque.

T0: Bouc-Wen. T1: three sliders (Prandtl-Ishlinskii).
"""

from __future__ import annotations

import numpy as np

from samrl_core.blind_test.disturbances.disturbance import Disturbance, Injection, Quantity, Site, quantile
from samrl_core.blind_test.disturbances.transmission.transmission_forms import LoopSpring
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    # Guessed at .1-.5 mrad of a joint of 1e4 N m/rad: 1..5 N m of loop.
    force = quantile(severity, 0.5, 4.0) * site.size**2
    base = 3e3 * site.size**2 if severity > 0 else 1e8  # [N m/rad] once the slider slips
    inner = 2.0 * base  # lost when it does
    width = 2.0 * force / base  # twist between loading and unloading [rad]

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        damping = 0.02 * float(np.sqrt(base * site.armature[site.joint]))
        if form == "T0":
            sliders = ((inner, force),)
        else:
            sliders = tuple((inner / 3.0, force / 3.0 * k) for k in (0.4, 1.0, 1.6))
        hooks.transmission[site.joint] = LoopSpring(base, damping, sliders, form == "T1")

    return Injection(
        {
            "a": Quantity(0.5 * width, "rad"),
            "loop_torque": Quantity(force, "N m"),
            "K": Quantity(base, "N m/rad"),
        },
        attach,
    )


DISTURBANCE = Disturbance("transmission_hysteresis", "joint", _make, shows_in="drive", twists=True)
