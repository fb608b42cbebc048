"""3: Stribeck friction."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import (
    FAST,
    DriveEffect,
    DriveForm,
    fastest_motion,
    widest_turn,
)
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.trial import Trial


class StribeckFriction(DriveEffect):
    """Dry friction that drops as the film builds up: stick-slip at crawling speed."""

    family, number, title = "stribeck_friction", 3, "Stribeck friction"
    proper_name = True
    meaning = "Friction is higher near standstill than at speed, which makes slow motion stick and slip."
    remedy = "Model friction with its falling part at low speed, or keep slow moves above the Stribeck speed."
    formula = "tau_f = (Fc + (Fs - Fc) s(|dq| / vs)) tanh(dq / v), s(x) = exp(-x^d) or 1 / (1 + x^2)"
    source = (
        "Armstrong-Helouvry et al. 1994 (d 1 to 2); Hess and Soom 1990 (rational); "
        "a Panda joint 7 drops from 0.52 to 0.30 N m by 0.15 rad/s"
    )
    excitation = "crawl at 0.01-0.2 rad/s"
    curve_over = "velocity"
    confounded_with = ("coulomb_friction", "presliding")
    contains = ("coulomb_friction",)
    parameters = (
        Parameter("Fc", "N m", 0.0, 1.5, "level at speed"),
        Parameter("drop", "N m", 0.05, 0.6, "Fs - Fc, rise towards rest"),
        Parameter("vs", "rad/s", 0.02, 0.3, "Stribeck velocity"),
        Parameter("d", "1", 0.8, 2.5, "exponent of the exponential drop"),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        # A drop that is not over at the fastest motion cannot be told from the level.
        fastest = fastest_motion(trial, place.joints)
        speeds = [vs for vs in (0.03, 0.08, 0.2, 0.6, 2.0) if vs < (fastest if vs < 0.5 else 0.6 * fastest)]
        widest = min(max(0.03, 0.05 * fastest), widest_turn(trial, place.joints, 0.1))
        slowest = max(min(0.6, fastest), 0.04) if fastest < FAST else 1.5 * fastest
        limits = {"v": (5e-4, max(widest, 0.011)), "vs": (0.01, slowest)}
        # A sign that turns too soon is mended by a drop that is none, and the search does not leave it.
        turns = [0.004, 0.6 * limits["v"][1]]
        grid = tuple({"v": v, "vs": vs} for vs in speeds or [0.03] for v in turns)
        exponents = tuple({**shape, "d": d} for d in (2.0, 1.0) for shape in grid)
        names = ("Fc", "drop")
        return (
            ExponentialDrop(
                name="exponential",
                place=place,
                amplitudes=names,
                shapes=exponents,
                refine={**limits, "d": (0.7, 2.6)},
            ),
            RationalDrop(name="rational", place=place, amplitudes=names, shapes=grid, refine=limits),
        )


class FallingForm(DriveForm):
    """A level and a drop towards it."""

    may_vanish = (0,)

    @abstractmethod
    def fall(self, x: np.ndarray, shape: Shape) -> np.ndarray:
        """Share of the drop that is left at a speed over Stribeck's."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        speed = trial.motion.sure_velocity[:, joint]
        sign = smooth_sign(speed, shape["v"])
        return np.stack([sign, sign * self.fall(np.abs(speed) / shape["vs"], shape)])

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(2, 0.1 * trial.scale[joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[1] > 0 and amplitudes[0] > -0.1 * amplitudes[1])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        found = {"Fc": float(amplitudes[0]), "drop": float(amplitudes[1]), "vs": shape["vs"]}
        return {**found, "d": shape["d"]} if "d" in shape else found

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {
            "coulomb": self.at_joints(trial, amplitudes[0]),
            "coulomb_velocity": self.at_joints(trial, shape["v"], 0.005),
            "stribeck_drop": self.at_joints(trial, amplitudes[1]),
            "stribeck_velocity": self.at_joints(trial, shape["vs"], 0.1),
            "stribeck_exponent": self.at_joints(trial, shape.get("d", 0.0), 2.0),
        }


class ExponentialDrop(FallingForm):
    """exp(-x^d)."""

    def fall(self, x: np.ndarray, shape: Shape) -> np.ndarray:
        return np.exp(-(x ** shape["d"]))


class RationalDrop(FallingForm):
    """1 / (1 + x^2)."""

    def fall(self, x: np.ndarray, shape: Shape) -> np.ndarray:
        return 1.0 / (1.0 + x**2)


EFFECT = StribeckFriction()
