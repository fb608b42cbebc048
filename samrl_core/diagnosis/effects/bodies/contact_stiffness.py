"""32: contact stiffness and damping, by how fast a body leaves its support after an impact."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import REBOUND, BodyTrial


class ContactStiffness(Effect[BodyTrial]):
    """The body rebounds faster or slower than its stated restitution says."""

    family, number, title = "contact_stiffness", 32, "Contact stiffness"
    meaning = "Contact is softer or harder than modelled, so force rises and rebounds differently."
    remedy = "Set the stiffness and damping of this pair, measured with taps at several speeds."
    formula = "v_after = -e v_before"
    source = "restitution 0.2-0.9 of balls on hard floors"
    acts_on = "contact"
    place_kind = "body"
    excitation = "bounces from several heights"
    confounded_with = ()
    parameters = (Parameter("e", "1", 0.0, 1.0, "coefficient of restitution"),)
    simulated = False

    def why_unobservable(self, trial: BodyTrial) -> str | None:
        if trial.recording.body.shape not in ("point", "sphere"):
            return "the rebound of a body with corners depends on which of them hits; needs a ball or a point"
        if REBOUND not in trial.channels:
            return "needs rebounds between two flights, with the height over the support measured"
        if "restitution" in trial.constants.free:
            return "nobody stated the restitution; it was solved for"
        return None

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        def sizes(t: BodyTrial, amplitudes: np.ndarray) -> dict[str, float]:
            return {"e": t.constants.restitution + float(amplitudes[0])}

        return (
            Restitution(
                place=place, amplitudes=("e",), of=columns.restitution, spreads=(0.15,), reported=sizes
            ),
        )


class Restitution(OfMotion):
    """Between none and a perfect rebound."""

    def is_admissible(self, trial: BodyTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(-0.02 < trial.constants.restitution + amplitudes[0] < 1.05)


EFFECT = ContactStiffness()
