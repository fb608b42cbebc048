"""12: transmission hysteresis."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import TorqueDeflection, single
from samrl_core.diagnosis.effects.shapes import bristle
from samrl_core.diagnosis.trial import Trial


class TransmissionHysteresis(TorqueDeflection):
    """The joint twists under torque with a loop that does not depend on the rate."""

    family, number, title = "transmission_hysteresis", 12, "transmission hysteresis"
    formula = "q_link = q_motor - a z, dz = dtau / ts (1 - z sgn dtau)"
    source = "Bouc-Wen family; harmonic drives: Tjahjowidodo et al. 2013"
    excitation = "quasi-static load cycles"
    confounded_with = ("presliding", "backlash", "joint_elasticity")
    parameters = (
        Parameter("a", "rad", 0.0001, 0.005, "half height of the loop"),
        Parameter("ts", "N m", 0.5, 30.0, "torque over which it builds up"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        (joint,) = self.joints_at(trial, place)
        span = max(
            float(
                np.ptp(trial.motion.u[:, joint] if trial.motion.u is not None else trial.motion.q[:, joint])
            ),
            1e-3,
        )
        return single(("a",), tuple({"ts": f * span} for f in (0.05, 0.2)), ts=(0.01 * span, span))

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        return bristle(torque, shape["ts"])[None]

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.005)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 1e-4)  # [rad] less is below what is known of drives

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"a": float(amplitudes[0]), "ts": shape["ts"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if "tracking" in trial.channels:
            return None
        joints = self.joints_at(trial, place)
        return {
            "hysteresis_amplitude": at_joint(trial, joints, amplitudes[0]),
            "hysteresis_torque": at_joint(trial, joints, shape["ts"], 1.0),
        }
