"""The friction that comes nearest where a simulator knows only a level and a slope.

Most simulators have joint friction of one level and viscous damping, nothing else. Stribeck, load,
position, warmth and asymmetry are projected on these two over the speeds, loads and positions that were
recorded: least squares of the friction torque, at rest left out, where any formula of friction is as good
as another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from samrl_core.diagnosis.export.correction import Correction

RESTING = 0.004  # [rad/s] below it friction is whatever holds the joint
PLAIN = ("coulomb", "viscous", "back_emf")  # a back-EMF is damping, as long as the motor is powered
BEYOND = (
    "stribeck_drop",
    "load_friction",
    "friction_asymmetry",
    "friction_harmonic_amplitude",
    "thermal_ratio",
    "cable_friction",
)  # what a level and a slope do not hold


@dataclass(frozen=True)
class LevelAndSlope:
    """Friction of a joint as most simulators have it, nominal part included."""

    friction: float  # [N m]
    damping: float  # [N m s/rad]
    error: float  # root mean square of what is left, over that of what was to be added; zero if exact
    speeds: tuple[float, float] = (0.0, 0.0)  # [rad/s] over which it was fitted


def level_and_slope(correction: Correction, joint: int) -> LevelAndSlope:
    """Friction and damping of a joint with its effects, or what comes nearest over the recorded motion."""
    c = correction
    level = float(c.friction[joint]) + c.at("coulomb", joint)
    slope = float(c.damping[joint]) + c.at("viscous", joint) + c.at("back_emf", joint)
    if not any(c.changes(name, joint) for name in BEYOND) and level >= 0 and slope >= 0:
        return LevelAndSlope(level, slope, 0.0)
    speed = c.motion["velocity"][:, joint]
    moving = np.abs(speed) > RESTING
    torque = friction_torque(c, joint)[moving]
    turned = np.tanh(speed[moving] / c.at("coulomb_velocity", joint))
    basis = np.stack([turned, speed[moving]], axis=1)
    (friction, damping), _ = nnls(basis, torque)
    nominal = basis @ np.array([c.friction[joint], c.damping[joint]])
    left = torque - basis @ np.array([friction, damping])
    added = float(np.sqrt(np.mean((torque - nominal) ** 2)))
    error = float(np.sqrt(np.mean(left**2))) / max(added, 1e-12)
    span = np.quantile(np.abs(speed[moving]), [0.02, 0.98])
    return LevelAndSlope(float(friction), float(damping), error, (float(span[0]), float(span[1])))


def friction_torque(correction: Correction, joint: int) -> np.ndarray:
    """Friction (N,) along the fitted motion, all terms of `PlantParameters` but the start of bristles."""
    c = correction
    time, q = c.motion["time"], c.motion["position"][:, joint]
    speed, load = c.motion["velocity"][:, joint], np.abs(c.motion["torque"][:, joint])

    def at(name: str) -> float:
        return c.at(name, joint)

    level = float(c.friction[joint]) + at("coulomb") + at("load_friction") * load
    x, exponent = np.abs(speed) / at("stribeck_velocity"), at("stribeck_exponent")
    level = level + at("stribeck_drop") * (np.exp(-(x**exponent)) if exponent else 1.0 / (1.0 + x**2))
    level = level + at("friction_harmonic_amplitude") * np.sin(
        at("friction_harmonic_order") * q + at("friction_harmonic_phase")
    )
    turned = np.tanh(speed / at("coulomb_velocity"))
    torque = level * turned + (float(c.damping[joint]) + at("viscous") + at("back_emf")) * speed
    torque = torque + at("friction_asymmetry") * turned**2
    warm = 1.0 + at("thermal_ratio") * np.exp(-(time + at("thermal_offset")) / at("thermal_time"))
    return torque * warm + at("cable_friction") * np.sign(speed)
