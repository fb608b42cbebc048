"""18: command delay."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import LateResponse
from samrl_core.diagnosis.trial import Trial


class CommandDelay(LateResponse):
    """What is commanded is done later."""

    family, number, title = "command_delay", 18, "command delay"
    formula = "x(t) = x_in(t - T)"
    source = "PACE bounds 0-25 ms; bus and firmware buffers 1-10 ms"
    excitation = "steps or chirp, at two gain sets"
    confounded_with = ("command_low_pass", "viscous_friction", "joint_elasticity")
    parameters = (Parameter("T", "s", 0.001, 0.025, "delay"),)
    symbol = "T"
    grid = (0.001, 0.002, 0.004, 0.008, 0.016, 0.03)
    limits = (5e-4, 0.1)
    tracking_grid = (0.01, 0.02, 0.04, 0.08, 0.16)

    def late(self, trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
        return trial.motion.delayed(x, shape["T"])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Less than a sample cannot be told from how the channels are stamped.
        return (
            super().admissible(trial, place, form, shape, amplitudes) and shape["T"] > 1.1 / trial.motion.rate
        )

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "tracking":
            return None
        joints = self.joints_at(trial, place)
        if form == "command":
            return {"command_delay": at_joint(trial, joints, shape["T"])}
        return {"effort_delay": at_joint(trial, joints, shape["T"])}
