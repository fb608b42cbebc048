"""23: torque-sensor error."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

# Further off is none of a sensor that works: all friction of a joint without load would be its gain.
MOST_GAIN = 0.34


class TorqueSensorError(Effect):
    """The link-side torque sensor has another gain or zero, drifts, or warms up."""

    family, number, title = "torque_sensor_error", 23, "Torque sensor error"
    meaning = "The torque reading has a wrong zero or a wrong scale."
    remedy = "Zero the sensor in an unloaded pose and check its scale with a known load."
    formula = "tau_read = (1 + g) tau + b (+ d t or + w exp(-t / T))"
    source = "biases of -0.43 to 0.05 N m seen on a Panda; warm-up drift of strain gauges: Keil 2017"
    acts_on = "reading"
    excitation = "static poses"
    experiment = "static"
    confounded_with = ("payload", "base_tilt", "actuator_gain")
    parameters = (
        Parameter("g", "1", -0.2, 0.2, "gain error"),
        Parameter("b", "N m", -1.0, 1.0, "bias; of a sensor that warms up, the one that it settles on"),
        Parameter("d", "N m/s", -0.1, 0.1, "drift"),
        Parameter("w", "N m", -1.0, 1.0, "what the bias still lacks when a recording starts, cold"),
        Parameter("T", "s", 0.5, 60.0, "time constant of the warm-up"),
    )

    def unobservable(self, trial: Trial) -> str | None:
        return None if "drive" in trial.channels else "needs commanded and link-side effort"

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        grid = tuple({"T": t} for t in (1.0, 4.0, 16.0))
        return (
            Form("gain and bias", ("g", "b")),
            Form("drift", ("b", "d")),
            Form("gain and drift", ("g", "b", "d")),
            Form("warm-up", ("g", "b", "w"), grid, {"T": (0.3, 60.0)}),
        )

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        (joint,) = self.joints_at(trial, place)
        motion = trial.motion
        one = np.ones(len(trial))
        zero = [one]
        if form.endswith("drift"):
            zero.append(motion.start_s + motion.t)
        elif form == "warm-up":
            # Powered for the recording: cold at each one's start.
            zero.append(np.exp(-(motion.t - motion.time[0]) / shape["T"]))
        if form == "drift":
            return trial.sensor(joint, np.stack(zero))
        # What the model expects of the sensor, never its own reading or what was sent: both hold the noise or
        # the friction that is left over, and where a joint carries no load a gain would explain them.
        expected = np.stack([trial.model_torque[:, joint], *zero])
        return trial.sensor(joint, expected)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        (joint,) = self.joints_at(trial, place)
        bias = 0.03 * trial.scale[joint]
        spread = [] if form == "drift" else [0.1]
        spread.append(bias)
        if form.endswith("drift"):
            spread.append(0.2 * bias)
        elif form == "warm-up":
            spread.append(bias)
        return np.zeros(len(spread)), np.array(spread)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(form == "drift" or abs(amplitudes[0]) < MOST_GAIN)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        values = dict(zip(self._names(form), amplitudes.tolist(), strict=True))
        found = {name: float(values.get(name, 0.0)) for name in ("g", "b", "d")}
        return found | ({"w": float(values["w"]), "T": shape["T"]} if form == "warm-up" else {})

    @staticmethod
    def _names(form: str) -> tuple[str, ...]:
        return {
            "drift": ("b", "d"),
            "gain and drift": ("g", "b", "d"),
            "warm-up": ("g", "b", "w"),
        }.get(form, ("g", "b"))

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "warm-up":
            return None  # the simulated sensor knows no warm-up
        joints = self.joints_at(trial, place)
        found = self.physical(trial, place, form, shape, amplitudes)
        return {
            "sensor_gain": at_joint(trial, joints, found["g"]),
            "sensor_bias": at_joint(trial, joints, found["b"]),
            "sensor_drift": at_joint(trial, joints, found["d"]),
        }


EFFECT = TorqueSensorError()
