"""41: lens distortion."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class LensDistortion(Effect[ImageTrial]):
    """Straight lines bend towards the image's edge otherwise than calibrated."""

    family, number, title = "lens_distortion", 41, "Lens distortion"
    meaning = "Straight lines bend towards the image's edge more or less than calibrated."
    remedy = "Calibrate the distortion with targets that reach the image's corners."
    formula = "x' = x (1 + k1 r2 + k2 r4) + 2 p1 x y + p2 (r2 + 2 x2)"
    source = "Brown 1966; k1 within +-0.05"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "objects in the image's corners"
    confounded_with = ("intrinsics", "rolling_shutter")
    parameters = (
        Parameter("k1", "1", -0.5, 0.5, "radial, second order"),
        Parameter("k2", "1", -0.5, 0.5, "radial, fourth order"),
        Parameter("p1", "1", -0.05, 0.05, "tangential"),
        Parameter("p2", "1", -0.05, 0.05, "tangential"),
    )
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        radial = ImageColumns(
            name="radial", place=place, amplitudes=("k1", "k2"), columns_of=("radial",), spreads=(0.06, 0.06)
        )
        whole = ImageColumns(
            name="with tangential",
            place=place,
            amplitudes=("k1", "k2", "p1", "p2"),
            columns_of=("radial", "tangential"),
            spreads=(0.06, 0.06, 0.003, 0.003),
        )
        return (radial, whole)


EFFECT = LensDistortion()
