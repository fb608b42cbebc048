"""54: torque offset."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, DriveForm
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.trial import Trial

SPREAD = 0.03  # of the joint's torque scale, as that of a sensor's bias


class TorqueOffset(DriveEffect):
    """The drive gives a constant torque beside the one that it is told: the zero of its current sensor."""

    family, number, title = "torque_offset", 54, "Torque offset"
    meaning = "The drive gives a constant torque more or less than it is told, at rest and in motion alike."
    remedy = "Calibrate the zero of the drive's current sensor, or add the offset to the model of the drive."
    formula = "tau = u + b"
    source = "EMPS, Janot, Gautier, Brunot 2019: an offset of -3.2 N is identified beside the friction"
    excitation = "the same poses in both directions, and rests"
    experiment = "slow"
    confounded_with = ("friction_asymmetry", "torque_sensor_error", "cable", "payload", "base_tilt")
    parameters = (Parameter("b", "N m", -2.0, 2.0, "torque that the drive gives beyond the one it is told"),)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        return (ConstantTorque(place=place, amplitudes=("b",)),)


class ConstantTorque(DriveForm):
    """One: what is given on top is one that is not lost."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full((1, len(trial.motion.time)), -1.0)

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(1, SPREAD * trial.scale[joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"b": float(amplitudes[0])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {"torque_offset": self.at_joints(trial, amplitudes[0])}


EFFECT = TorqueOffset()
