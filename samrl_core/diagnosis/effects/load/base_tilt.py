"""26: base tilt."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_link_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial


class BaseTilt(Effect):
    """The base does not stand upright: gravity pulls from elsewhere."""

    family, number, title = "base_tilt", 26, "Tilt of the base"
    meaning = "The arm stands at an angle, so gravity pulls in another direction than the model thinks."
    remedy = "Level the base, or set gravity's direction in model and controller to the fitted one."
    formula = "g - (ax, ay, 0) x g in the base's frame: the base leans by (ax, ay) about its x and y"
    source = "mounting plates: 0-2 degrees"
    acts_on = "dynamics"
    place_kind = "arm"
    excitation = "turn the first joint fully, hold"
    experiment = "static"
    curve_over = "position"
    confounded_with = ("encoder_offset", "torque_sensor_error", "payload")
    parameters = (
        Parameter("ax", "rad", -0.12, 0.12, "about the base's x"),
        Parameter("ay", "rad", -0.12, 0.12, "about the base's y"),
    )

    def why_unobservable(self, trial: Trial) -> str | None:
        return lacks_link_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        return (TiltedGravity(place=place, amplitudes=("ax", "ay")),)


class TiltedGravity(Form):
    """Gravity turned by two small angles."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.link(trial.tilt)

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(2), np.full(2, 0.03)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"ax": float(amplitudes[0]), "ay": float(amplitudes[1])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        assert trial.rigid is not None
        g = trial.rigid.gravity_vector
        axis = np.array([amplitudes[0], amplitudes[1], 0.0])
        return {"gravity": g - np.cross(axis, g)}


EFFECT = BaseTilt()
