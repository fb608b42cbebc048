"""11: joint elasticity."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import Deflection, single
from samrl_core.diagnosis.trial import Trial


class JointElasticity(Deflection):
    """The joint twists under torque, like a spring between motor and link."""

    family, number, title = "joint_elasticity", 11, "joint elasticity"
    formula = "q_link = q_motor - tau / K"
    source = "Spong 1987; harmonic drives of this size: 5e3-2e4 N m/rad"
    excitation = "chirp of 1-20 Hz"
    confounded_with = ("backlash", "command_delay", "mount_compliance")
    parameters = (Parameter("K", "N m/rad", 500.0, 50000.0, "joint stiffness"),)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return single(("compliance",))

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        return torque[None] - np.mean(torque) * (1.0 if "tracking" in trial.channels else 0.0)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        (joint,) = self.joints_at(trial, place)
        if "tracking" in trial.channels:
            return np.zeros(1), np.full(1, 0.02 / trial.scale[joint])
        return np.zeros(1), np.full(1, 0.02 / trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0 or "tracking" in trial.channels)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"K": float(1.0 / max(abs(amplitudes[0]), 1e-12))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if "tracking" in trial.channels:
            return None
        joints = self.joints_at(trial, place)
        return {"joint_stiffness": at_joint(trial, joints, 1.0 / max(amplitudes[0], 1e-9), np.inf)}
