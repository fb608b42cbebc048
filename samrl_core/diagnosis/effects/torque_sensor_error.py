"""23: torque-sensor error."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial


class TorqueSensorError(Effect):
    """The link-side torque sensor has another gain or zero, or drifts."""

    family, number, title = "torque_sensor_error", 23, "torque-sensor error"
    formula = "tau_read = (1 + g) tau + b (+ d t)"
    source = "biases of -0.43 to 0.05 N m seen on a Panda"
    acts_on = "reading"
    excitation = "static poses"
    confounded_with = ("payload", "base_tilt", "actuator_gain")
    parameters = (
        Parameter("g", "1", -0.2, 0.2, "gain error"),
        Parameter("b", "N m", -1.0, 1.0, "bias"),
        Parameter("d", "N m/s", -0.1, 0.1, "drift"),
    )

    def unobservable(self, trial: Trial) -> str | None:
        return None if "drive" in trial.channels else "needs commanded and link-side effort"

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return (Form("gain and bias", ("g", "b")), Form("drift", ("b", "d")))

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        (joint,) = self.joints_at(trial, place)
        one = np.ones(len(trial))
        if form == "drift":
            return trial.sensor(joint, np.stack([one, trial.motion.start_s + trial.motion.t]))
        # What each side of the sensor expects of it, never its own reading: see Trial.transmitted.
        assert trial.motion.u is not None
        expected = trial.motion.u[:, joint] - trial.rotor[joint] * trial.motion.ddq[:, joint]
        return trial.sensor(joint, np.stack([expected, one]), np.stack([trial.model_torque[:, joint], one]))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        (joint,) = self.joints_at(trial, place)
        bias = 0.03 * trial.scale[joint]
        return np.zeros(2), np.array([0.1, bias] if form != "drift" else [bias, 0.2 * bias])

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        if form == "drift":
            return {"g": 0.0, "b": float(amplitudes[0]), "d": float(amplitudes[1])}
        return {"g": float(amplitudes[0]), "b": float(amplitudes[1]), "d": 0.0}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        found = self.physical(trial, place, form, shape, amplitudes)
        return {
            "sensor_gain": at_joint(trial, joints, found["g"]),
            "sensor_bias": at_joint(trial, joints, found["b"]),
            "sensor_drift": at_joint(trial, joints, found["d"]),
        }
