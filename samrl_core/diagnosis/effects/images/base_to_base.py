"""30: transform between the bases, as images show it."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import SIX_SPREADS, ImageColumns
from samrl_core.diagnosis.effects.pose_forms import SIX, six_parameters
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class BaseToBaseByImages(Effect[ImageTrial]):
    """The arms do not stand to each other as stated."""

    family, number, title = "base_to_base", 30, "Transform between the bases"
    meaning = "The two arms, or the base and a still target, do not stand to each other as the model says."
    remedy = "Multiply the stated transform by the fitted one, or measure it again from several poses."
    formula = "tool base = stated tool base . exp(x, y, z, rx, ry, rz)"
    source = "0.5-10 mm and 0.05-1 degree"
    acts_on = "reading"
    place_kind = "cell"
    excitation = "many poses of the camera that show the tool; a still camera cannot tell it from hand-eye"
    confounded_with = ("hand_eye", "encoder_offset")
    parameters = six_parameters(0.05, 0.1, "the tool arm's base")
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (ImageColumns(place=place, amplitudes=SIX, columns_of=("base",), spreads=SIX_SPREADS),)


EFFECT = BaseToBaseByImages()
