"""28: cable or hose."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.shapes import smooth_sign
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial

LEAST_PULL = 0.1  # of the hysteresis, that the spring must change by over the travel


class Cable(Effect):
    """A cable outside the arm pulls a joint back, with some friction of its own."""

    family, number, title = "cable", 28, "cable or hose"
    formula = "tau_c = k (q - q0) + h tanh(dq / v)"
    source = "dress packs: 0-2 N m/rad"
    acts_on = "dynamics"
    excitation = "sweep of the wrist"
    confounded_with = ("position_dependent_friction", "payload", "encoder_offset")
    parameters = (
        Parameter("k", "N m/rad", 0.05, 3.0, "stiffness"),
        Parameter("q0", "rad", -3.2, 3.2, "rest position"),
        Parameter("h", "N m", 0.0, 0.5, "hysteresis"),
    )

    def unobservable(self, trial: Trial) -> str | None:
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            return "needs a torque and a dynamic model"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return (Form("", ("k", "kq0", "h")),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        (joint,) = self.joints_at(trial, place)
        motion = trial.motion
        sign = motion.reduce(smooth_sign(motion.full_velocity[:, joint], 0.01))
        rows = np.zeros((3, len(trial), trial.joints))
        rows[0, :, joint], rows[1, :, joint], rows[2, :, joint] = motion.q[:, joint], -1.0, sign
        return trial.link(rows)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        (joint,) = self.joints_at(trial, place)
        scale = trial.scale[joint]
        return np.zeros(3), np.array([0.05 * scale, 0.05 * scale, 0.01 * scale])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        (joint,) = self.joints_at(trial, place)
        # Hysteresis without a spring is dry friction under another name.
        pull = amplitudes[0] * float(np.ptp(trial.motion.q[:, joint]))
        return bool(amplitudes[0] > 0 and pull > LEAST_PULL * abs(amplitudes[2]))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        k = float(amplitudes[0])
        return {"k": k, "q0": float(amplitudes[1]) / k if k else 0.0, "h": float(amplitudes[2])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {
            "cable_stiffness": at_joint(trial, joints, amplitudes[0]),
            "cable_rest": at_joint(trial, joints, amplitudes[1] / amplitudes[0]),
            "cable_friction": at_joint(trial, joints, amplitudes[2]),
        }
