"""21: encoder offset."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial


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

    def unobservable(self, trial: Trial) -> str | None:
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            return "needs a torque and a dynamic model"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return (Form("", ("e",)),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        (joint,) = self.joints_at(trial, place)
        return trial.link(trial.deflection(joint, np.ones((1, len(trial)))))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.03)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"e": float(amplitudes[0])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {"encoder_offset": at_joint(trial, joints, amplitudes[0])}


EFFECT = EncoderOffset()
