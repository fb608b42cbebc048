"""46: clock offset or drift: a camera's frames come faster than their stamps say, or slower."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.body_forms import OfMotion, needs_flight
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial


class RateByBodies(Effect[BodyTrial]):
    """The camera's stamps run faster or slower than time, so bodies seem to fall slower or faster."""

    family, number, title = "clock_offset", 46, "Clock offset or drift"
    meaning = "Two devices' clocks disagree, and more so with time."
    remedy = "Read the true frame rate from the recording's stamps, or film a clock; correct the stamps."
    formula = "stamp = (1 + e) time: accelerations seem 1 / (1 + e)^2 times as large"
    source = "video that is played at 25 or 29.97 instead of 30 frames per second; slow motion"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "falls tell it together with a clock in the picture"
    confounded_with = ("object_geometry", "contact_friction")
    parameters = (
        Parameter("drift", "1", -0.5, 0.5, "seconds per second by which stamps run ahead of time", False),
    )
    simulated = False

    def why_unobservable(self, trial: BodyTrial) -> str | None:
        return needs_flight(trial)

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        return (
            Slower(place=place, amplitudes=("drift",), of=columns.scale, spreads=(0.1,), reported=_drift),
        )


class Slower(OfMotion):
    """The amplitude is the share of acceleration that is not seen."""

    def is_admissible(self, trial: BodyTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] < 0.9)


def _drift(trial: BodyTrial, amplitudes: np.ndarray) -> dict[str, float]:
    return {"drift": float(1.0 / np.sqrt(max(1.0 - amplitudes[0], 1e-3)) - 1.0)}


EFFECT = RateByBodies()
