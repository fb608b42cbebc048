"""4: load-dependent friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, single
from samrl_core.diagnosis.effects.shapes import SIGN_SPEEDS, smooth_sign
from samrl_core.diagnosis.trial import Trial


class LoadDependentFriction(DriveTorque):
    """Friction that grows with the transmitted torque."""

    family, number, title = "load_dependent_friction", 4, "load-dependent friction"
    formula = "tau_f = Kl |tau| tanh(dq / v)"
    source = "Duclos 2025, BAM: extended friction models for servo actuators (Kl 0-0.5)"
    excitation = "the same sweep at several loads"
    confounded_with = ("coulomb_friction", "payload", "actuator_gain")
    parameters = (Parameter("Kl", "1", 0.02, 0.5, "friction per transmitted torque"),)

    def unobservable(self, trial: Trial) -> str | None:
        if trial.motion.tau is None and trial.motion.u is None:
            return "needs a torque"
        return super().unobservable(trial)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return single(("Kl",), tuple({"v": v} for v in SIGN_SPEEDS), v=(5e-4, 0.05))

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        motion = trial.motion
        # The model's load: a reading has an offset, which would make plain Coulomb friction of it, and the
        # commanded effort holds the friction itself.
        load = np.abs(np.interp(motion.time, motion.t, trial.model_torque[:, joint]))
        return (load * smooth_sign(motion.full_velocity[:, joint], shape["v"]))[None]

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.array([0.2])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"Kl": float(amplitudes[0])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {
            "load_friction": at_joint(trial, joints, amplitudes[0]),
            "coulomb_velocity": at_joint(trial, joints, shape["v"], 0.005),
        }
