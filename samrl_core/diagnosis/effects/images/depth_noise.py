"""43: depth noise."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class DepthNoise(Effect[ImageTrial]):
    """Depth scatters more or less than is stated of the sensor; nothing is shifted."""

    family, number, title = "depth_noise", 43, "Depth noise"
    meaning = "Depth scatters more or less than the model's noise."
    remedy = "Set the noise level in the model, and check lighting and the camera's projector."
    formula = "deviation of depth = s z^2 0.08 px / (447 px 0.05 m)"
    source = "subpixel deviation 0.08 px (Intel's tuning guide), times 0.5 to 3"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "any surface without edges, at rest"
    confounded_with = ("depth_dropout",)
    parameters = (Parameter("log_s", "log", -3.0, 3.0, "logarithm of the spread against what is stated"),)
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (
            ImageColumns(place=place, amplitudes=("log_s",), columns_of=("depth_noise",), spreads=(0.6,)),
        )


EFFECT = DepthNoise()
