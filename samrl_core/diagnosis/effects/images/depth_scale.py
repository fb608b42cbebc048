"""42: depth scale, as images of a known scene show it."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class DepthScaleByImages(Effect[ImageTrial]):
    """Depth is off by a factor or an offset, while outlines stay."""

    family, number, title = "depth_scale", 42, "Depth scale"
    meaning = "Depth readings are off by a factor or an offset."
    remedy = "Correct depth by the fitted coefficients, or calibrate on a plane at three or more distances."
    formula = "z_read = (1 + a) z + b"
    source = "Intel states 2 % at 2 m; 1.87 % was measured of a D435"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "table and object from 0.27 to 0.6 m"
    confounded_with = ("hand_eye", "intrinsics", "object_geometry")
    parameters = (
        Parameter("a", "1", -0.1, 0.1, "factor less one"),
        Parameter("b", "m", -0.03, 0.03, "offset"),
    )
    simulated = False
    forms_may_be_one = True

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        scale = ImageColumns(
            name="scale", place=place, amplitudes=("a",), columns_of=("depth_scale",), spreads=(0.012,)
        )
        offset = ImageColumns(
            name="offset", place=place, amplitudes=("b",), columns_of=("depth_offset",), spreads=(0.004,)
        )
        line = ImageColumns(
            name="line",
            place=place,
            amplitudes=("a", "b"),
            columns_of=("depth_scale", "depth_offset"),
            spreads=(0.012, 0.004),
            surprise=1.0,
        )
        return (scale, offset, line)


EFFECT = DepthScaleByImages()
