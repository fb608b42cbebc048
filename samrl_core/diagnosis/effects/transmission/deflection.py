"""Effects by which the link trails the joint's reading by an angle."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial


class Deflection(Effect):
    """The link trails the joint's reading by an angle."""

    acts_on = "dynamics"
    # What engines and sampling do to fast motion looks like a little give.
    prior_cost = 2.0

    def why_unobservable(self, trial: Trial) -> str | None:
        """Needs torques."""
        return lacks_measured_torque(trial)


def lacks_measured_torque(trial: Trial) -> str | None:
    """Why a recording cannot show what a torque twists; None if it can."""
    if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
        if "tracking" in trial.channels and trial.motion.tau is not None:
            return None
        # What a servo commands is its answer to the very error that should be explained by it.
        return "needs a measured torque, not only a commanded one"
    return None


class TwistForm(Form):
    """The angle depends on the transmitted torque alone."""

    by_turns: ClassVar[bool] = False  # the torque's turning points count

    @abstractmethod
    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        """Deflection (p, N) per unit amplitude [rad] under the transmitted torque (N,) [N m]."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        """Motor-side reading: the link is where its inertia and weight are felt."""
        joint = self.joint
        if "tracking" in trial.channels:
            load = trial.motion.tau if trial.motion.tau is not None else trial.motion.u
            assert load is not None
            return trial.tracking(joint, self.angle(trial, load[:, joint], shape))
        fine = trial.transmitted_finely if self.by_turns else None
        if fine is None:
            angle = self.angle(trial, trial.transmitted[:, joint], shape)
        else:
            angle = trial.from_fine(self.angle(trial, fine[:, joint], shape))
        return trial.link(trial.deflection(joint, angle))

    def line(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> float:
        """Stiffness [N m/rad] of the straight line through what the torque does to the angle."""
        torque = trial.transmitted[:, self.joint]
        angle = amplitudes @ self.angle(trial, torque, shape)
        compliance = float(np.polyfit(torque - np.mean(torque), angle, 1)[0])
        return 1.0 / max(compliance, 1e-12)
