"""49: geometry of the object: what gives a track its length is larger or smaller than stated."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.body_forms import OfMotion, needs_flight
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial


class ScaleByBodies(Effect[BodyTrial]):
    """The tag or the ruler that gives the track its unit is larger than stated: all lengths seem shorter."""

    family, number, title = "object_geometry", 49, "Geometry of the object"
    meaning = "The object's size differs from its description: a printed target was scaled, for example."
    remedy = "Measure the tag, the body or the ruler in the picture, and scale the track by it."
    formula = "position seen = position / (1 + s)"
    source = "printers scale by 1-5 %; a ruler beside the plane of motion by 1-10 %"
    acts_on = "reading"
    place_kind = "body"
    excitation = "falls tell it together with a length of known size beside the path"
    confounded_with = ("clock_offset", "contact_friction")
    parameters = (Parameter("s", "1", -0.5, 0.5, "by which what gives the unit is larger", False),)
    simulated = False

    def why_unobservable(self, trial: BodyTrial) -> str | None:
        return needs_flight(trial)

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        return (Shorter(place=place, amplitudes=("s",), of=columns.scale, spreads=(0.1,), reported=_size),)


class Shorter(OfMotion):
    """The amplitude is the share of every length that is not seen."""

    def is_admissible(self, trial: BodyTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] < 0.9)


def _size(trial: BodyTrial, amplitudes: np.ndarray) -> dict[str, float]:
    return {"s": float(1.0 / max(1.0 - amplitudes[0], 1e-3) - 1.0)}


EFFECT = ScaleByBodies()
