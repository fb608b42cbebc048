"""13: reflected inertia."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, single
from samrl_core.diagnosis.trial import Trial


class ReflectedInertia(DriveTorque):
    """Rotor inertia that the nominal model does not have."""

    family, number, title = "reflected_inertia", 13, "reflected inertia"
    formula = "tau_f = Ja ddq"
    source = "MuJoCo Menagerie panda.xml has armature 0.1"
    excitation = "multisine with high accelerations"
    confounded_with = ("link_inertia", "controller_gain", "actuator_gain")
    parameters = (Parameter("Ja", "kg m2", 0.01, 1.0, "rotor inertia seen at the joint, beyond nominal"),)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return single(("Ja",))

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return trial.motion.full_acceleration[:, [joint]].T

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.array([0.5 * max(trial.scale[joint] / 87.0, 0.1)])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > -trial.rotor[self.joints_at(trial, place)[0]])

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"Ja": float(amplitudes[0])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {"rotor_inertia": at_joint(trial, joints, amplitudes[0])}
