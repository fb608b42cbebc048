"""27: mount compliance."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.basis_functions import resonant
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_JOINTS = 3  # of fewer, the wrench on the stand is nearly a joint's own torque


class MountCompliance(Effect):
    """The stand gives way and swings under the arm's own reactions."""

    family, number, title = "mount_compliance", 27, "Compliant mount"
    meaning = "Table or stand gives way and swings when the arm accelerates."
    remedy = "Stiffen or bolt the stand; otherwise model it as a spring and damper and avoid its frequency."
    formula = "base angle x'' + 2 z w x' + w^2 x = w^2 M / k"
    source = "light stands and tables: 3-30 Hz"
    acts_on = "dynamics"
    place_kind = "arm"
    simulated = False
    prior_cost = 2.0  # as of other deflections
    excitation = "impulses, chirp; a camera on another stand"
    experiment = "chirp"
    renamed_shapes = (
        "f",
        "z",
    )
    confounded_with = ("joint_elasticity", "base_tilt")
    parameters = (
        Parameter("frequency", "Hz", 2.0, 30.0, "natural frequency with the arm on it"),
        Parameter("damping", "1", 0.01, 0.5, "damping ratio"),
        Parameter("compliance", "rad/(N m)", 1e-06, 0.001, "angle per moment, or m/N for a shift"),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        if len(trial.recording.arm.joints) < LEAST_JOINTS:
            return "with fewer than three joints a stand's reaction cannot be told from the joints' own"
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        grid = tuple({"f": f, "z": 0.05} for f in (3.0, 4.5, 6.5, 9.0, 13.0, 19.0))
        limits = {"f": (1.5, 40.0), "z": (0.005, 1.0)}
        return tuple(
            make(name=name, place=place, amplitudes=("x", "y"), shapes=grid, refine=limits)
            for make, name in ((RotatingMount, "rotation"), (ShiftingMount, "shift"))
        )


class SwingingMount(Form):
    """A base that swings about or along two axes; `spread` and `least` are its compliance."""

    spread: ClassVar[float]  # of the prior
    least: ClassVar[float]  # less is how far the base of any arm gives: COMPLIANCE in nominal.py for joints

    @abstractmethod
    def swing(self, trial: Trial, axis: int, shape: Shape) -> np.ndarray:
        """Joint torques (N, J) per unit compliance about or along an axis of the base."""

    def respond(self, trial: Trial, component: int, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Deflection (N,) under a component of the wrench, and joint torques (N, J) of its acceleration."""
        wrench, unit = trial.base_reaction
        angle = resonant(wrench[:, component], shape["f"], shape["z"], trial.motion.dt)
        return angle, unit[component] * trial.motion.second_derivative(angle)[:, None]

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(np.stack([self.swing(trial, axis, shape) for axis in (0, 1)]))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(2), np.full(2, self.spread)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        most = float(np.max(amplitudes))
        return bool(most > self.least and np.min(amplitudes) > -0.3 * most)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"frequency": shape["f"], "damping": shape["z"], "compliance": float(np.max(amplitudes))}


class RotatingMount(SwingingMount):
    """The stand tilts under the moment."""

    spread = 0.02 / 100.0  # [rad/(N m)]
    least = 1.5e-5  # [rad/(N m)]

    def swing(self, trial: Trial, axis: int, shape: Shape) -> np.ndarray:
        angle, torque = self.respond(trial, 3 + axis, shape)
        return torque + trial.tilt[axis] * angle[:, None]


class ShiftingMount(SwingingMount):
    """The stand shifts under the force."""

    spread = 0.01 / 100.0  # [m/N]
    least = 1e-5  # [m/N]

    def swing(self, trial: Trial, axis: int, shape: Shape) -> np.ndarray:
        return self.respond(trial, axis, shape)[1]


EFFECT = MountCompliance()
