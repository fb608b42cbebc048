"""48: lighting and exposure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.colors import find_driven_to_white
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial

MOST = 50.0  # logarithm of more light than there is


class Lighting(Effect[ImageTrial]):
    """The whole scene is brighter or darker than the model expects; edges and depth stay."""

    family, number, title = "lighting", 48, "Lighting and exposure"
    meaning = "The scene is brighter or darker than the model expects; its hue is not compared."
    remedy = "Fix the exposure, and shield or model the light."
    formula = "brightness = (1 + g) expected"
    source = "gain 0.5 to 2"
    acts_on = "reading"
    place_kind = "cell"
    excitation = "surfaces of several colours"
    confounded_with = ("object_geometry",)
    parameters = (Parameter("g", "1", -0.9, 3.0, "share by which all is brighter"),)
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (Brightness(place=place, amplitudes=("log_gain",), columns_of=("light",), spreads=(0.4,)),)


@dataclass(frozen=True, eq=False, kw_only=True)
class Brightness(ImageColumns):
    """Its amplitude is a logarithm, as the rows of brightness are."""

    def parameters(self, trial: ImageTrial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"g": float(np.expm1(min(amplitudes[0], MOST)))}

    def find_seen(self, trial: ImageTrial, shape: Shape, amplitudes: np.ndarray) -> ImageTrial:
        """Without the colours that so much light would drive to white."""
        (expected,) = trial.column("light")["color", 0]  # as bright as a surface is, so much light adds to it
        rows = find_driven_to_white(expected, trial.surfaces("color"), min(float(amplitudes[0]), MOST))
        return trial.without("color", rows) if rows.any() else trial


EFFECT = Lighting()
