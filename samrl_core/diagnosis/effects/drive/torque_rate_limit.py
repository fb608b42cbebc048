"""16: torque-rate limit."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, FixedResponse, single
from samrl_core.diagnosis.residuals.basis_functions import rate_limited
from samrl_core.diagnosis.residuals.trial import Trial


class TorqueRateLimit(FixedResponse, DriveTorque):
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

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        (joint,) = self.joints_at(trial, place)
        most = 1.0
        if trial.motion.raw_commanded is not None:
            steps = np.abs(np.diff(trial.motion.raw_commanded[:, joint]))
            most = max(float(np.quantile(steps, 0.999)) * trial.motion.rate, 1e-6)
        return single(
            ("present",),
            # Other recordings of the arm may move faster than the first.
            tuple({"R": f * most} for f in (0.05, 0.1, 0.2, 0.35, 0.6, 0.85, 1.2, 2.0)),
            R=(0.01 * most, 4.0 * most),
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        assert trial.motion.raw_commanded is not None
        # As it was sent, with what sensor noise does through the gains: a limit acts on that as well.
        u = trial.motion.raw_commanded[:, joint]
        return (u - rate_limited(u, shape["R"] / trial.motion.rate))[None]

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.ones(1)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"R": shape["R"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {"effort_rate_limit": at_joint(trial, joints, shape["R"], np.inf)}


EFFECT = TorqueRateLimit()
