"""17: command low-pass."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import LateResponse
from samrl_core.diagnosis.residuals.basis_functions import low_passed, resonant
from samrl_core.diagnosis.residuals.trial import Trial

SECOND = "second order"


class CommandLowPass(LateResponse):
    """A filter of first or second order between what is commanded and what is done."""

    family, number, title = "command_low_pass", 17, "Low-pass filter on the command"
    meaning = "A filter between command and drive smooths and delays fast changes."
    remedy = "Find the filter in controller or drive and model it with its cut-off, or raise the cut-off."
    formula = "x' = 2 pi fc (x_in - x), or Butterworth of second order: x'' = w (w (x_in - x) - sqrt(2) x')"
    source = "libfranka: first order, 100 Hz by default, up to 1000 Hz; drives: second-order torque filters"
    excitation = "chirp to 10-30 Hz"
    experiment = "chirp"
    confounded_with = ("command_delay", "joint_elasticity", "torque_rate_limit")
    parameters = (Parameter("fc", "Hz", 0.5, 100.0, "cutoff frequency, at -3 dB"),)
    symbol = "fc"
    grid = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
    limits = (0.2, 200.0)
    tracking_grid = (0.5, 1.0, 2.0, 4.0, 8.0)

    variants = ("", SECOND)

    def limits_at(self, trial: Trial) -> tuple[float, float]:
        """Up to a third of the sampling rate: faster filters are lost in what is aliased."""
        low, high = self.limits
        return low, min(high, trial.motion.rate / 3.0)

    def late(self, trial: Trial, x: np.ndarray, form: str, shape: Shape) -> np.ndarray:
        if form.endswith(SECOND):
            return resonant(x, shape["fc"], np.sqrt(0.5), 1.0 / trial.motion.rate)
        return low_passed(x, shape["fc"], trial.motion.rate)

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "tracking" or form.endswith(SECOND):
            return None  # the simulator's filters are of first order
        joints = self.joints_at(trial, place)
        if form == "command":
            return {"command_cutoff": at_joint(trial, joints, shape["fc"], np.inf)}
        return {"effort_cutoff": at_joint(trial, joints, shape["fc"], np.inf)}


EFFECT = CommandLowPass()
