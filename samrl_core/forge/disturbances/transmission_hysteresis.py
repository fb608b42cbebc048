"""12. Transmission hysteresis: loops of twist over torque. T0: Bouc-Wen. T1: three sliders (Prandtl-Ishlinskii)."""

from __future__ import annotations

import numpy as np

from samrl_core.forge.disturbances.disturbance import Effect, Family, Quantity, Site, quantile
from samrl_core.forge.disturbances.transmission_forms import LoopSpring
from samrl_core.forge.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Effect:
    width = quantile(severity, 2e-4, 4e-3)  # twist between loading and unloading [rad]; guessed .1-.5 mrad and up
    base = 4e3 * site.size**2  # [N m/rad]; without loops the twist itself would show, small beside them
    inner = 3.0 * base  # stiffness that is lost when the slider yields
    force = base * width / 2.0

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        damping = 0.02 * float(np.sqrt(base * site.armature[site.joint]))
        if form == "T0":
            sliders = ((inner, force),)
        else:
            sliders = tuple((inner / 3.0, force / 3.0 * k) for k in (0.4, 1.0, 1.6))
        hooks.transmission[site.joint] = LoopSpring(base * (1e3 if severity == 0 else 1.0), damping, sliders, form == "T1")

    return Effect(
        {
            "loop_width": Quantity(width, "rad"),
            "loop_torque": Quantity(force, "N m"),
            "K": Quantity(base, "N m/rad"),
        },
        attach,
    )


FAMILY = Family("transmission_hysteresis", "joint", _make)
