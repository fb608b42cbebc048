"""48: lighting and exposure."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class Lighting(Effect[ImageTrial]):
    """The whole scene is brighter or darker than the model expects; edges and depth stay."""

    family, number, title = "lighting", 48, "Lighting and exposure"
    meaning = "The scene's brightness or colour differs from the model."
    remedy = "Fix exposure and white balance, and shield or model the light."
    formula = "brightness = (1 + g) expected"
    source = "gain 0.5 to 2"
    acts_on = "reading"
    place_kind = "cell"
    excitation = "surfaces of several colours"
    confounded_with = ("object_geometry",)
    parameters = (Parameter("g", "1", -0.9, 3.0, "share by which all is brighter"),)
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (ImageColumns(place=place, amplitudes=("g",), columns_of=("light",), spreads=(0.4,)),)


EFFECT = Lighting()
