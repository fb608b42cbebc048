"""2: viscous friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import BEYOND, ShaftFriction, single
from samrl_core.diagnosis.residuals.trial import Trial


class ViscousFriction(ShaftFriction):
    """Friction in proportion to speed."""

    family, number, title = "viscous_friction", 2, "Viscous friction"
    meaning = "A torque that grows in proportion to joint speed brakes the motion."
    remedy = (
        "Set the joint's damping in the model to the fitted value; it depends on grease and temperature, so "
        "measure again warm."
    )
    formula = "tau_f = Fv dq"
    source = "ranges: Gaz et al. 2019; MuJoCo Menagerie panda.xml has damping 1"
    excitation = "several cruise speeds"
    curve_over = "velocity"
    confounded_with = ("coulomb_friction", "command_delay", "controller_gain")
    parameters = (Parameter("Fv", "N m s/rad", 0.05, 2.0, "friction per speed"),)
    at_every_joint = True
    # Drag that grows with the square of speed is a steeper line less a dry friction; none is negative.
    least_share = 0.75

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        (form,) = single(("Fv",))
        return self.coupled_forms(trial, form) if place.startswith("arm:") else (form,)

    def of_shaft(
        self, trial: Trial, first: int, second: int, sign: float, form: str, shape: Shape
    ) -> np.ndarray:
        speed = trial.motion.full_velocity
        return (speed[:, first] + sign * speed[:, second])[None]

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return trial.motion.full_velocity[:, [joint]].T

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        speed = float(np.sqrt(np.mean(trial.motion.full_velocity[:, joint] ** 2))) + 1e-9
        return np.array([0.1 * trial.scale[joint] / max(speed, 0.05)])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return self.positive(trial, place, amplitudes)

    def beyond_nominal(self, trial: Trial, joint: int) -> float:
        tolerance = np.broadcast_to(trial.recording.arm.tolerances.viscous_friction, (trial.joints,))[joint]
        assert trial.rigid is not None
        speed = float(trial.rigid.velocity_limits()[joint])
        return BEYOND * float(tolerance) * trial.scale[joint] / (speed if np.isfinite(speed) else 1.0)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return self.sizes(trial, place, form, "Fv", amplitudes)

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {"viscous": at_joint(trial, joints, amplitudes)}


EFFECT = ViscousFriction()
