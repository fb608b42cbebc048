"""16: torque-rate limit."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, lose_torque
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, PresentForm, Shape
from samrl_core.diagnosis.residuals.basis_functions import rate_limited
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

MOST_LIMITED = 0.75  # share of samples at which the torque changes as fast as it may


class TorqueRateLimit(DriveEffect):
    """The drive's torque cannot change faster than a rate."""

    family, number, title = "torque_rate_limit", 16, "Torque rate limit"
    meaning = "The drive changes its torque only so fast, so steps turn into ramps."
    remedy = "Add the rate limit to the model, and smooth the commands so that they stay below it."
    formula = "|dtau/dt| <= R"
    source = "libfranka: 1000 N m/s"
    excitation = "steps, fast reversals"
    experiment = "chirp"
    confounded_with = ("command_low_pass", "command_delay", "torque_saturation")
    parameters = (Parameter("R", "N m/s", 5.0, 1000.0, "largest rate"),)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        (joint,) = place.joints
        most = 1.0
        if trial.motion.raw_commanded is not None:
            steps = np.abs(np.diff(trial.motion.raw_commanded[:, joint]))
            most = max(float(np.quantile(steps, 0.999)) * trial.motion.rate, 1e-6)
        # Other recordings of the arm may move faster than the first.
        grid = tuple({"R": f * most} for f in (0.05, 0.1, 0.2, 0.35, 0.6, 0.85, 1.2, 2.0))
        limits = {"R": (0.01 * most, 4.0 * most)}
        return (LimitedRate(place=place, amplitudes=("present",), shapes=grid, refine=limits),)


class LimitedRate(PresentForm):
    """What a limit of the rate takes away from the effort as it was sent."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        motion = trial.motion
        # With what sensor noise does through the gains: a limit acts on that as well. A torque that was
        # computed from a log, or logged now and then, has noise that acted on no drive from sample to sample;
        # it is in the residual too, and a limit that takes it away would seem to be right.
        sent = motion.raw_commanded if motion.holds_every_torque else motion.sure_torque
        assert sent is not None
        u = sent[:, self.joint]
        lost = (u - rate_limited(u, shape["R"] / trial.motion.rate))[None]
        return lose_torque(trial, self.place, lambda _: lost)

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        """Below some rate all torque is lost: an idle joint's friction under another name."""
        u = trial.motion.sure_torque[:, self.joint]
        most = shape["R"] / trial.motion.rate
        steps = np.abs(np.diff(rate_limited(u, most)))
        return bool(np.mean(steps > 0.999 * most) < MOST_LIMITED)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"R": shape["R"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {"effort_rate_limit": self.at_joints(trial, shape["R"], np.inf)}


EFFECT = TorqueRateLimit()
