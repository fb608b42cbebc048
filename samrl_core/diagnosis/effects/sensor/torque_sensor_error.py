"""23: torque-sensor error."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
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

    def why_unobservable(self, trial: Trial) -> str | None:
        return None if "link" in trial.channels else "needs link-side effort"

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        named = {
            "gain and bias": ("g", "b"),
            "drift": ("b", "d"),
            "gain and drift": ("g", "b", "d"),
        }
        grid = tuple({"T": t} for t in (1.0, 4.0, 16.0))
        return (
            *(WrongReading(name=name, place=place, amplitudes=terms) for name, terms in named.items()),
            WrongReading(
                name="warm-up",
                place=place,
                amplitudes=("g", "b", "w"),
                shapes=grid,
                refine={"T": (0.3, 60.0)},
            ),
        )


class WrongReading(Form):
    """A reading with some of the terms: gain, bias, drift, warm-up."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.sensor(self.joint, np.stack([self.term(trial, a, shape) for a in self.amplitudes]))

    def term(self, trial: Trial, amplitude: str, shape: Shape) -> np.ndarray:
        """What is read (N,) per unit of an amplitude."""
        motion = trial.motion
        match amplitude:
            case "g":
                # What the model expects of the sensor, never its own reading or what was sent: both hold the
                # noise or the friction that is left over, and where a joint carries no load a gain would
                # explain them.
                return trial.model_torque[:, self.joint]
            case "d":
                return motion.session
            case "w":
                # Powered for the recording: cold at each one's start.
                return np.exp(-(motion.t - motion.time[0]) / shape["T"])
        return np.ones(len(trial))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        bias = 0.03 * trial.scale[self.joint]
        spread = {"g": 0.1, "b": bias, "d": 0.2 * bias, "w": bias}
        return np.zeros(len(self.amplitudes)), np.array([spread[a] for a in self.amplitudes])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool("g" not in self.amplitudes or abs(amplitudes[0]) < MOST_GAIN)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        # A term that the form lacks is not known to be zero: nothing is said of it.
        found = dict(zip(self.amplitudes, amplitudes.tolist(), strict=True))
        return found | ({"T": shape["T"]} if "T" in shape else {})

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if "w" in self.amplitudes:
            return None  # the simulated sensor knows no warm-up
        found = {"g": 0.0, "d": 0.0, **self.parameters(trial, shape, amplitudes)}
        drifted = found["d"] * trial.motion.start_s  # the simulated drift begins anew with each recording
        return {
            "sensor_gain": self.at_joints(trial, found["g"]),
            "sensor_bias": self.at_joints(trial, found["b"] + drifted),
            "sensor_drift": self.at_joints(trial, found["d"]),
        }


EFFECT = TorqueSensorError()
