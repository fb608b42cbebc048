"""10: backlash."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import Deflection, single
from samrl_core.diagnosis.effects.shapes import play
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial


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
        return single(
            ("b",),
            tuple({"t0": f * trial.scale[joint]} for f in (0.002, 0.01, 0.03)),
            t0=(1e-4 * trial.scale[joint], 0.1 * trial.scale[joint]),
        )

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        if form == "load":
            middle = 0.5 * (np.max(torque) + np.min(torque))
            return np.tanh((torque - middle) / (0.1 * np.std(torque) + 1e-12))[None]
        return np.tanh(torque / shape["t0"])[None]

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
        return np.zeros(1), np.full(1, 0.01)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0 or form == "load")

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
