"""27: mount compliance."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape
from samrl_core.diagnosis.residuals.basis_functions import resonant
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_ROTATION = 1.5e-5  # [rad/(N m)]
LEAST_SHIFT = 1e-5  # [m/N]


class MountCompliance(Effect):
    """The stand gives way and swings under the arm's own reactions."""

    family, number, title = "mount_compliance", 27, "Compliant mount"
    meaning = "Table or stand gives way and swings when the arm accelerates."
    remedy = "Stiffen or bolt the stand; otherwise model it as a spring and damper and avoid its frequency."
    formula = "base angle x'' + 2 z w x' + w^2 x = w^2 M / k"
    source = "light stands and tables: 3-30 Hz"
    acts_on = "dynamics"
    place_kind = "arm"
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

    def unobservable(self, trial: Trial) -> str | None:
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            return "needs a torque and a dynamic model"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        grid = tuple({"f": f, "z": 0.05} for f in (3.0, 4.5, 6.5, 9.0, 13.0, 19.0))
        limits = {"f": (1.5, 40.0), "z": (0.005, 1.0)}
        return (Form("rotation", ("x", "y"), grid, limits), Form("shift", ("x", "y"), grid, limits))

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        assert trial.rigid is not None
        wrench, unit = trial.base_reaction
        rows = []
        for axis in (0, 1):
            load = wrench[:, 3 + axis] if form == "rotation" else wrench[:, axis]
            angle = resonant(load, shape["f"], shape["z"], trial.motion.dt)
            second = trial.motion.second_derivative(angle)
            row = unit[3 + axis if form == "rotation" else axis] * second[:, None]
            if form == "rotation":
                row = row + trial.tilt[axis] * angle[:, None]
            rows.append(row)
        return trial.link(np.stack(rows))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        assert trial.rigid is not None
        weight = 100.0
        spread = 0.02 / weight if form == "rotation" else 0.01 / weight
        return np.zeros(2), np.full(2, spread)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Less is how far the base of any arm gives: see COMPLIANCE in nominal.py for joints.
        least = LEAST_ROTATION if form == "rotation" else LEAST_SHIFT
        most = float(np.max(amplitudes))
        return bool(most > least and np.min(amplitudes) > -0.3 * most)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"frequency": shape["f"], "damping": shape["z"], "compliance": float(np.max(amplitudes))}


EFFECT = MountCompliance()
