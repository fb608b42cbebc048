"""10: backlash."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import Deflection, single
from samrl_core.diagnosis.effects.shapes import play
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial

LEAST_GAP = 3e-5  # [rad] below it a gap is smaller than what encoders of arms resolve


class Backlash(Deflection):
    """Lost motion: the link is free within a gap, and jumps when the load changes sides."""

    family, number, title = "backlash", 10, "backlash"
    formula = "q_link = q_motor - b sgn(tau), smoothed over +-t0"
    source = "Nordin and Gutman 2002, Controlling mechanical systems with backlash"
    excitation = "load reversals, with both sides observed"
    confounded_with = ("joint_elasticity", "transmission_hysteresis", "coulomb_friction")
    parameters = (Parameter("b", "rad", 0.0001, 0.02, "half width of the gap"),)

    def unobservable(self, trial: Trial) -> str | None:
        return None if "tracking" in trial.channels else super().unobservable(trial)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            return (Form("load", ("b",)),) if trial.motion.u is not None else (Form("direction", ("b",)),)
        (joint,) = self.joints_at(trial, place)
        # Behind the gap the teeth bend: without it, a soft tooth would be taken for a plain spring.
        return single(
            ("b", "compliance"),
            tuple({"t0": f * trial.scale[joint]} for f in (0.0005, 0.003, 0.015)),
            t0=(1e-5 * trial.scale[joint], 0.1 * trial.scale[joint]),
        )

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        if form == "load":
            middle = 0.5 * (np.max(torque) + np.min(torque))
            return np.tanh((torque - middle) / (0.1 * np.std(torque) + 1e-12))[None]
        return np.stack([np.tanh(torque / shape["t0"]), torque])

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        if form == "direction":
            (joint,) = self.joints_at(trial, place)
            command = trial.motion.command
            assert command is not None and command.position is not None
            path = trial.motion.reduce(command.position)[:, joint]
            gap = 0.01
            return trial.tracking(joint, ((path - play(path, gap)) / gap)[None])
        return super().columns(trial, place, form, shape)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        if "tracking" in trial.channels:
            return np.zeros(1), np.full(1, 0.01)
        (joint,) = self.joints_at(trial, place)
        return np.zeros(2), np.array([0.01, 3e-3 / trial.scale[joint]])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        if "tracking" in trial.channels:
            return bool(amplitudes[0] > 0 or form == "load")
        (joint,) = self.joints_at(trial, place)
        return bool(amplitudes[0] > LEAST_GAP and amplitudes[1] > -1e-4 / trial.scale[joint])

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"b": float(abs(amplitudes[0]))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form:
            return None
        joints = self.joints_at(trial, place)
        return {"backlash": at_joint(trial, joints, amplitudes[0])}
