"""14: actuator gain."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, DriveForm
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.trial import Trial


class ActuatorGain(DriveEffect):
    """The drive turns commanded torque into another torque: torque constant, current scale."""

    family, number, title = "actuator_gain", 14, "Actuator torque gain"
    meaning = (
        "The drive delivers a fixed fraction more or less torque than it is told: its motor, or its supply."
    )
    remedy = (
        "Scale the torque constant in the model or recalibrate the drive; it acts on gravity compensation "
        "too. Supply: measure the voltage under load and scale the gains and the voltage limit by it."
    )
    formula = "tau = (1 + e) (u - b dq); supply: tau = (1 + e) u - b dq, b dq the loss to back-EMF"
    source = "drift of magnets and current sensors: +-10 %; a battery from full to empty: -25 %"
    excitation = "static poses and motion"
    experiment = "two_loads"
    confounded_with = ("payload", "torque_sensor_error", "load_dependent_friction")
    parameters = (Parameter("e", "1", -0.3, 0.3, "relative error of the torque"),)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        motor = ScaledTorque(place=place, amplitudes=("e",), thing="motor")
        if not np.any(trial.motion.back_emf_loss[:, list(place.joints)]):
            return (motor,)
        return (motor, ScaledSupply(name="supply", place=place, amplitudes=("e",), thing="supply"))


class ScaledTorque(DriveForm):
    """A share of the torque that the drive must have delivered."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        # By the model, and not what was sent: that contains the very friction that is left over, and beside
        # another rotor it would explain any residual by itself.
        return -trial.delivered_torque[:, [joint]].T

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.array([0.15])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        # A larger one would be another drive, and would stand in for friction wherever friction is most.
        return bool(abs(amplitudes[0]) < 0.35)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        # Of the torque delivered, not of the torque sent: u - (1 + e) u = -e / (1 + e) (1 + e) u.
        return {"e": float(amplitudes[0] / (1.0 - amplitudes[0]))}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        error = self.parameters(trial, shape, amplitudes)["e"]
        fields: PlantFields = {"actuator_gain": self.at_joints(trial, error)}
        controller = trial.recording.arm.controller
        if controller is not None and np.any(np.asarray(controller.law.back_emf) > 0):
            # A motor of another constant or resistance loses as much more to its speed.
            loss = controller.law.of_joints("back_emf", trial.joints)
            fields["back_emf"] = error * self.at_joints(trial, loss[list(self.place.joints)])
        return fields


class ScaledSupply(ScaledTorque):
    """A voltage of another supply: all that is sent scales with it, what the speed takes does not.

    The duty cycle is the drive's own, so that its gains and its limit scale alike.
    """

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        motion = trial.motion
        sent = trial.delivered_torque[:, joint] + motion.back_emf_loss[:, joint]
        return -(motion.enabled[:, joint] * sent)[None]

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {"actuator_gain": self.at_joints(trial, self.parameters(trial, shape, amplitudes)["e"])}


EFFECT = ActuatorGain()
