"""4: load-dependent friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, DriveForm, turn_widths, widest_turn
from samrl_core.diagnosis.effects.effect import Parameter, lacks_drive_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.trial import Trial


class LoadDependentFriction(DriveEffect):
    """Friction that grows with the transmitted torque, and is another when the load drives the motor."""

    family, number, title = "load_dependent_friction", 4, "Load-dependent friction"
    meaning = "The gear rubs harder the more torque it transmits, so friction changes with pose and payload."
    remedy = (
        "Make the friction in the model a function of transmitted torque; do not tune it at one payload only."
    )
    formula = "tau_f = Kl |tau| tanh(dq / v), or Kb |tau| tanh(dq / v) while tau dq < 0"
    source = "Duclos 2025, BAM: extended friction models for servo actuators (Kl 0-0.5; also directional)"
    excitation = "the same sweep at several loads"
    experiment = "two_loads"
    curve_over = "velocity"
    confounded_with = ("coulomb_friction", "payload", "actuator_gain")
    parameters = (
        Parameter("Kl", "1", 0.02, 0.5, "friction per transmitted torque, where the motor drives"),
        Parameter("Kb", "1", 0.0, 0.5, "the same where the load drives, if it is another"),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        if trial.motion.tau is None and trial.motion.u is None:
            return "needs a torque"
        return lacks_drive_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        widest = max(0.05, widest_turn(trial, place.joints, 0.05))
        grid, limits = tuple({"v": v} for v in turn_widths(widest)), {"v": (5e-4, widest)}
        return (
            ByLoad(place=place, amplitudes=("Kl",), shapes=grid, refine=limits),
            # Gears lose more, or less, while the load drives them.
            ByLoad(name="directional", place=place, amplitudes=("Kl", "Kb"), shapes=grid[:2], refine=limits),
        )


class ByLoad(DriveForm):
    """A share of the load; with a second amplitude, another share while the load drives."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        motion = trial.motion
        if motion.u is not None and not motion.u[:, joint].any():
            # Nothing drives it: all that it transmits is its friction, and the model's load is the residual.
            return np.zeros((len(self.amplitudes), len(motion.time)))
        # The model's load: a reading has an offset, which would make plain Coulomb friction of it, and the
        # commanded effort holds the friction itself.
        load = np.interp(motion.time, motion.t, trial.model_torque[:, joint])
        speed = motion.sure_velocity[:, joint]
        lost = np.abs(load) * smooth_sign(speed, shape["v"])
        if "Kb" not in self.amplitudes:
            return lost[None]
        driving = load * speed > 0
        return np.stack([lost * driving, lost * ~driving])

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(len(self.amplitudes), 0.2)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(np.all(amplitudes > 0))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return dict(zip(self.amplitudes, amplitudes.tolist(), strict=True))

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # The simulator knows one share: that of both directions together.
        return {
            "load_friction": self.at_joints(trial, float(np.mean(amplitudes))),
            "coulomb_velocity": self.at_joints(trial, shape["v"], 0.005),
        }


EFFECT = LoadDependentFriction()
