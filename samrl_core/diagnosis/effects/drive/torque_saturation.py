"""15: torque saturation."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, FixedResponse
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

SOFT_KNEES = (4.0, 14.0)  # exponents p from which the search begins
SOFTNESS = (2.0, 40.0)  # from a very soft knee to what is nearly a clip
MOST_LIMITED = 0.75  # share of samples beyond the limit


class TorqueSaturation(FixedResponse, DriveTorque):
    """The drive gives less than is asked for, above a limit that the model does not know."""

    family, number, title = "torque_saturation", 15, "Torque saturation"
    meaning = (
        "The drive cannot exceed a torque that is lower than the model's limit, so fast moves are flattened."
    )
    remedy = (
        "Set the model's effort limit to the fitted value, or slow the motion; check supply and drive limits."
    )
    formula = "tau = clip(u, -L, L), or u / (1 + |u / L|^p)^(1/p) with a soft knee"
    source = "drive limits by firmware or supply; soft: iron and supply give way before they end"
    excitation = "fast moves with high torques"
    confounded_with = ("torque_rate_limit", "actuator_gain")
    parameters = (Parameter("L", "N m", 1.0, 87.0, "torque limit"),)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        (joint,) = self.joints_at(trial, place)
        most = float(np.max(np.abs(trial.motion.u[:, joint]))) if trial.motion.u is not None else 1.0
        grid = tuple({"L": f * most} for f in (0.05, 0.12, 0.25, 0.4, 0.6, 0.75, 0.85, 0.92, 0.96))
        limits = {"L": (0.02 * most, 1.3 * most)}
        soft = tuple({"L": f * most, "p": p} for p in SOFT_KNEES for f in (0.7, 0.85, 1.0, 1.1, 1.25))
        forms = (
            Form("drive", ("present",), grid, limits),
            Form("soft", ("present",), soft, {"L": (0.1 * most, 1.5 * most), "p": SOFTNESS}),
        )
        return forms + (
            (Form("controller", ("present",), grid, limits),) if trial.equations.law is not None else ()
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        x = trial.equations.law if form == "controller" else trial.motion.raw_commanded
        assert x is not None
        u, most = x[:, joint], shape["L"]
        if form == "soft":
            return (u - u / (1.0 + np.abs(u / most) ** shape["p"]) ** (1.0 / shape["p"]))[None]
        return (u - np.clip(u, -most, most))[None]

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        if form == "controller":
            (joint,) = self.joints_at(trial, place)
            return trial.controller(joint, self.torque(trial, joint, form, shape))
        return super().columns(trial, place, form, shape)

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.ones(1)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # A drive that were in its limit nearly all of the time would not be a limit, but another law.
        x = trial.equations.law if form == "controller" else trial.motion.raw_commanded
        (joint,) = self.joints_at(trial, place)
        limited = x is None or np.mean(np.abs(x[:, joint]) > shape["L"]) > MOST_LIMITED
        return super().admissible(trial, place, form, shape, amplitudes) and not limited

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"L": shape["L"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        # The simulator clips; a soft knee loses most where a clip at its asymptote begins to.
        joints = self.joints_at(trial, place)
        return {"effort_limit": at_joint(trial, joints, shape["L"], np.inf)}


EFFECT = TorqueSaturation()
