"""31: contact friction, of a body that slides or rolls on its support."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial


class ContactFriction(Effect[BodyTrial]):
    """The support brakes the body more or less than its stated coefficient does."""

    family, number, title = "contact_friction", 31, "Contact friction"
    meaning = "Touching surfaces slip earlier or later than the model thinks."
    remedy = "Set the friction coefficient of this pair of materials, measured at several normal forces."
    formula = "a = -(mu + b |v|) N / m v / |v|"
    source = "0.1-1.0 for sliding; air tables 0.001-0.02; rolling 0.001-0.02"
    acts_on = "contact"
    place_kind = "body"
    excitation = "slides in two directions, to rest; on an incline up and down"
    confounded_with = ("base_tilt", "clock_offset", "object_geometry")
    parameters = (
        Parameter("mu", "1", 0.0, 1.5, "coefficient of friction at low speed"),
        Parameter("b", "s/m", -0.5, 0.5, "its growth with speed"),
    )
    simulated = False

    def why_unobservable(self, trial: BodyTrial) -> str | None:
        if not trial.slides:
            return "needs sliding or rolling on the support"
        if "friction" in trial.constants.free:
            return "nobody stated the coefficient; it was solved for"
        return None

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        def both(t: BodyTrial) -> dict[tuple[str, int], np.ndarray]:
            first, second = columns.friction(t), columns.friction_by_speed(t)
            return {key: np.concatenate([first[key], second[key]]) for key in first}

        def sizes(t: BodyTrial, amplitudes: np.ndarray) -> dict[str, float]:
            found = {"mu": t.constants.friction + float(amplitudes[0])}
            return found | ({"b": float(amplitudes[1])} if len(amplitudes) > 1 else {})

        growth = OfMotion(
            name="grows with speed, mu as stated", place=place, amplitudes=("b",),
            of=columns.friction_by_speed, spreads=(0.1,), surprise=2.0,
        )  # fmt: skip
        return (
            growth,
            Coefficient(
                name="coefficient", place=place, amplitudes=("mu",), of=columns.friction, spreads=(0.15,),
                reported=sizes,
            ),
            Coefficient(
                name="grows with speed", place=place, amplitudes=("mu", "b"), of=both, spreads=(0.15, 0.1),
                surprise=2.0, reported=sizes,
            ),
        )  # fmt: skip


class Coefficient(OfMotion):
    """No support pushes a body forward."""

    def is_admissible(self, trial: BodyTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(trial.constants.friction + amplitudes[0] > -0.02)


EFFECT = ContactFriction()
