"""14: actuator gain."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, single
from samrl_core.diagnosis.residuals.trial import Trial


class ActuatorGain(DriveTorque):
    """The drive turns commanded torque into another torque: torque constant, current scale."""

    family, number, title = "actuator_gain", 14, "Actuator torque gain"
    meaning = "The drive delivers a fixed fraction more or less torque than it is told."
    remedy = (
        "Scale the torque constant in the model or recalibrate the drive; it acts on gravity compensation "
        "too."
    )
    formula = "tau = (1 + e) u"
    source = "drift of magnets and current sensors: +-10 %"
    excitation = "static poses and motion"
    experiment = "two_loads"
    confounded_with = ("payload", "torque_sensor_error", "load_dependent_friction")
    parameters = (Parameter("e", "1", -0.3, 0.3, "relative error of the torque"),)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return single(("e",))

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        # What the drive must have delivered, by the model, and not what was sent: that contains the very
        # friction that is left over, and beside another rotor it would explain any residual by itself.
        return -(trial.rigid_torque + trial.rotor_share)[:, [joint]].T

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.array([0.15])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # A larger one would be another drive, and would stand in for friction wherever friction is most.
        return bool(abs(amplitudes[0]) < 0.35)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        # Of the torque delivered, not of the torque sent: u - (1 + e) u = -e / (1 + e) (1 + e) u.
        return {"e": float(amplitudes[0] / (1.0 - amplitudes[0]))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        gain = self.physical(trial, place, form, shape, amplitudes)["e"]
        return {"actuator_gain": at_joint(trial, joints, gain)}


EFFECT = ActuatorGain()
