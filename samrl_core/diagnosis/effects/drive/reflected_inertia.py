"""13: reflected inertia."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import BEYOND, DriveTorque, single
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_SHARE = 0.05  # of a joint's own inertia, from which a rotor counts when all joints are said to have one


class ReflectedInertia(DriveTorque):
    """Rotor inertia that the nominal model does not have."""

    family, number, title = "reflected_inertia", 13, "Reflected rotor inertia"
    meaning = (
        "The rotor's inertia seen through the gear differs from the model, which shows during acceleration."
    )
    remedy = "Correct the joint's armature in the model; check gear ratio and rotor inertia of the drive."
    formula = "tau_f = Ja ddq"
    source = "MuJoCo Menagerie panda.xml has armature 0.1"
    excitation = "multisine with high accelerations"
    curve_over = "acceleration"
    confounded_with = ("link_inertia", "controller_gain", "actuator_gain")
    parameters = (Parameter("Ja", "kg m2", 0.01, 1.0, "rotor inertia seen at the joint, beyond nominal"),)
    at_every_joint = True

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return single(("Ja",))

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return trial.motion.full_acceleration[:, [joint]].T

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.array([0.5 * max(trial.scale[joint] / 87.0, 0.1)])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        joints = self.joints_at(trial, place)
        if len(joints) == 1:
            return bool(amplitudes[0] > -trial.rotor[joints[0]])
        return self.positive(trial, place, amplitudes)

    def beyond_nominal(self, trial: Trial, joint: int) -> float:
        known = BEYOND * trial.recording.arm.tolerances.armature * float(trial.rotor[joint])
        return max(known, LEAST_SHARE * float(np.mean(trial.mass[:, joint, joint])))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return self.sizes(trial, place, form, "Ja", amplitudes)

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {"rotor_inertia": at_joint(trial, joints, amplitudes)}


EFFECT = ReflectedInertia()
