"""39: hand-eye calibration, as images show it."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import SIX_SPREADS, ImageColumns
from samrl_core.diagnosis.effects.pose_forms import SIX, six_parameters
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class HandEyeByImages(Effect[ImageTrial]):
    """The camera sits elsewhere on its flange than is stated."""

    family, number, title = "hand_eye", 39, "Hand-eye calibration"
    meaning = "The camera does not sit on the flange (or stand in the cell) where the model says."
    remedy = "Multiply the stated transform by the fitted one, or calibrate again; check the camera's screws."
    formula = "camera = stated camera . exp(x, y, z, rx, ry, rz)"
    source = "0.5-5 mm and 0.05-1 degree; 2 cm after a knock"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "ten or more views from 0.27 to 0.6 m, rolled by 75 degrees"
    confounded_with = ("base_to_base", "intrinsics", "encoder_offset")
    parameters = six_parameters(0.05, 0.1, "the camera")
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (ImageColumns(place=place, amplitudes=SIX, columns_of=("hand_eye",), spreads=SIX_SPREADS),)


EFFECT = HandEyeByImages()
