"""13: reflected inertia."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import BEYOND, DriveEffect, DriveForm, are_positive, name_sizes
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_SHARE = 0.05  # of a joint's own inertia, from which a rotor counts when all joints are said to have one


class ReflectedInertia(DriveEffect):
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

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        return (RotorTorque(place=place, amplitudes=("Ja",)),)


class RotorTorque(DriveForm):
    """The acceleration itself."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return trial.motion.sure_acceleration[:, [joint]].T

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.array([0.5 * max(trial.scale[joint] / 87.0, 0.1)])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        joints = self.place.joints
        if len(joints) == 1:
            return bool(amplitudes[0] > -trial.rotor[joints[0]])
        return are_positive(self.place, amplitudes, lambda j: _beyond_tolerance(trial, j))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "Ja", amplitudes)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        change = self.at_joints(trial, amplitudes)
        return None if np.any(change < -trial.rotor) else {"rotor_inertia": change}


def _beyond_tolerance(trial: Trial, joint: int) -> float:
    known = BEYOND * trial.recording.arm.tolerances.armature * float(trial.rotor[joint])
    return max(known, LEAST_SHARE * float(np.mean(trial.mass[:, joint, joint])))


EFFECT = ReflectedInertia()
