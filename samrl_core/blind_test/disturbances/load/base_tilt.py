"""26. A tilted base: gravity turns in its frame.

T0: constant. T1: a base that settles during the recording.
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
from samrl_core.blind_test.engines.hooks import Hooks


def tilted(gravity: np.ndarray, ax: float, ay: float) -> np.ndarray:
    """Gravity (3,) in axes that stand turned by small angles about x, then y [rad]."""
    cx, sx, cy, sy = np.cos(ax), np.sin(ax), np.cos(ay), np.sin(ay)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return (about_y @ about_x).T @ gravity


def _make(site: Site, form: str, severity: float) -> Injection:
    angle = log_quantile(severity, 0.002, 0.035)  # to 2 degrees
    way = float(site.rng.uniform(-np.pi, np.pi))
    ax, ay = angle * float(np.cos(way)), angle * float(np.sin(way))

    def turn(t: float, gravity: np.ndarray) -> np.ndarray:
        share = 1.0 if form == "T0" else 1.15 - 0.4 * np.exp(-max(t, 0.0) / 5.0)
        return tilted(gravity, share * ax, share * ay)

    def attach(hooks: Hooks, rng: np.random.Generator) -> None:
        hooks.gravity.append(turn)

    return Injection({"ax": Quantity(ax, "rad"), "ay": Quantity(ay, "rad")}, attach)


DISTURBANCE = Disturbance("base_tilt", "arm", _make, shows_in="link")
