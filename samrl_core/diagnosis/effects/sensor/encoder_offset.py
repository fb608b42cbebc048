"""21: encoder offset."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

MOST_RAD = 0.1  # offset that shows nowhere
UNSEEN = 1e-6  # of the effort scale: a torque that no log holds


class EncoderOffset(Effect):
    """A joint reads a constant angle too much; the arm hangs elsewhere than it says."""

    family, number, title = "encoder_offset", 21, "Encoder offset"
    meaning = "The joint's zero is off by a constant angle: it believes it stands where it does not."
    remedy = "Recalibrate the joint's zero; confirm with an outside measurement of the tool's position."
    formula = "q_read = q + e"
    source = "0.001-0.02 rad; PACE bounds 0.1 rad"
    acts_on = "reading"
    excitation = "many poses; an external pose"
    experiment = "static"
    curve_over = "position"
    confounded_with = ("base_tilt", "payload", "kinematic_error")
    parameters = (Parameter("e", "rad", 0.001, 0.1, "offset of the reading"),)

    def why_unobservable(self, trial: Trial) -> str | None:
        """Needs a torque that changes with some joint's position: an upright axis or a slide has none."""
        if (lacks := lacks_link_torque(trial)) is not None:
            return lacks
        most = MOST_RAD * np.max(np.abs(trial.stiffness), axis=(0, 2))  # of each joint's torque
        if np.all(most < UNSEEN * np.asarray(trial.scale)):
            return (
                "no torque here changes with a joint's zero: gravity and inertia are alike all along an"
                " upright axis or a slide; measure the pose from outside"
            )
        return None

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        return (ConstantError(place=place, amplitudes=("e",)),)


class ConstantError(Form):
    """The link trails its reading by a constant angle."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(trial.deflection(self.joint, np.ones((1, len(trial)))))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.03)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"e": float(amplitudes[0])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {"encoder_offset": self.at_joints(trial, amplitudes[0])}


EFFECT = EncoderOffset()
