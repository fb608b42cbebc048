"""17. Low-pass on the command or on the effort. T0: first order. T1: second order, damping ratio 0.7."""

from __future__ import annotations

import numpy as np
from scipy.signal import bilinear

from samrl_core.blind_test.disturbances.disturbance import (
    Disturbance,
    Injection,
    Quantity,
    Site,
    log_quantile,
)
from samrl_core.blind_test.disturbances.drive.command_path import RunningFilter, map_command, recursive
from samrl_core.blind_test.engines.hooks import Hooks


def _make(site: Site, form: str, severity: float) -> Injection:
    on_command = bool(site.rng.random() < 0.5)
    # libfranka's default is 100 Hz; an effort filter below 15 Hz would destabilise the described gains.
    slowest = 3.0 if on_command else 15.0
    corner = 1.0 / max(log_quantile(severity, 1 / 100.0, 1 / slowest), 1e-9)
    joints = list(range(site.joints)) if site.joint < 0 else [site.joint]
    period = site.spec.controller.period_s
    w = 2 * np.pi * corner
    if corner > 1e4:  # no filter
        b, a = np.array([1.0]), np.array([1.0, 0.0])
    elif form == "T0":
        keep = float(np.exp(-w * period))
        b, a = np.array([1.0 - keep]), np.array([1.0, -keep])
    else:
        b, a = (np.asarray(x) for x in bilinear([w * w], [1.0, 1.4 * w, w * w], 1.0 / period))

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        if on_command:
            hooks.command.append(lambda command: map_command(command, joints, recursive(b, a)))
        else:
            hooks.drive.append(RunningFilter(b, a, joints))

    where = Quantity("command" if on_command else "effort", "channel")
    return Injection({"fc": Quantity(corner, "Hz"), "acts_on": where}, attach)


DISTURBANCE = Disturbance("command_low_pass", "joint", _make, shows_in="either", also_arm=True)
