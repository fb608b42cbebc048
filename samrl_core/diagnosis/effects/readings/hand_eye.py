"""39: hand-eye calibration, as depth against planes of known pose sees it: along the optical axis alone."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.reading_forms import Polynomial, needs
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial


class HandEyeByDepth(Effect[ReadingTrial]):
    """The camera sits nearer to the planes, or farther from them, than is stated."""

    family, number, title = "hand_eye", 39, "Hand-eye calibration"
    meaning = "The camera does not sit on the flange (or stand in the cell) where the model says."
    remedy = "Move the stated camera along its axis by the fitted length, or calibrate it by poses."
    formula = "z_read = z - z_camera"
    source = "0.5-5 mm"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "planes at several distances tell it from a factor, never from an offset of the sensor"
    confounded_with = ("depth_scale",)
    parameters = (Parameter("z", "m", -0.03, 0.03, "by which the camera sits farther forward"),)
    simulated = False

    def why_unobservable(self, trial: ReadingTrial) -> str | None:
        return needs(trial, "depth")

    def forms(self, trial: ReadingTrial, place: Place) -> tuple[Form[ReadingTrial], ...]:
        # An offset of the sensor is the same at every depth, beside whatever else its scale does.
        return (
            Polynomial(
                place=place, amplitudes=("z",), powers=(0,), spreads=(0.01,), sign=-1.0, done_by="depth_scale"
            ),
        )


EFFECT = HandEyeByDepth()
