"""36: mass of the object: where its centre lies and how it resists turning; never how heavy it is."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial

BOTH_WAYS = 0.3  # of a ball's or a roller's share of inertia: solid to hollow


class ObjectMass(Effect[BodyTrial]):
    """The centre of mass or the moments of inertia differ from what is stated."""

    family, number, title = "object_mass", 36, "Mass of the object"
    meaning = "The object's mass or its centre differs from the model."
    remedy = "Weigh the object, balance it, and correct its mass and centre in the model."
    formula = "free flight of the centre c; I w' = I w x w; rolling a = g_t / (1 + k)"
    source = "hollow or loaded objects: centres off by 1-20 mm, inertia by 10-60 %"
    acts_on = "contact"
    place_kind = "body"
    excitation = "tosses that turn about two axes; mass itself: a known force, or a scale"
    confounded_with = ("base_tilt",)
    parameters = (
        Parameter("cx", "m", -0.05, 0.05, "by which the centre lies farther along the body's x"),
        Parameter("cy", "m", -0.05, 0.05, "along its y"),
        Parameter("cz", "m", -0.05, 0.05, "along its z"),
        Parameter("ix", "1", -0.6, 0.6, "error of the first moment of inertia against the third"),
        Parameter("iy", "1", -0.6, 0.6, "of the second against the third"),
        Parameter("k", "1", 0.0, 1.0, "inertia over mass and squared radius of what rolls"),
    )
    simulated = False

    def why_unobservable(self, trial: BodyTrial) -> str | None:
        if trial.recording.track.turns or _rolls(trial):
            return None
        return (
            "mass drops out of free flight and of sliding; its centre and inertia show by turns, not measured"
        )

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        out: list[Form[BodyTrial]] = []
        if trial.recording.track.turns:
            out.append(
                OfMotion(
                    name="centre", place=place, amplitudes=("cx", "cy", "cz"), of=columns.center,
                    spreads=(0.01, 0.01, 0.01),
                )
            )  # fmt: skip
        if "rotation_x" in trial.channels:
            out.append(
                OfMotion(
                    name="inertia", place=place, amplitudes=("ix", "iy"), of=columns.inertia,
                    spreads=(0.2, 0.2),
                )
            )  # fmt: skip
        if _rolls(trial):
            out.append(
                Roller(
                    name="rolling", place=place, amplitudes=("k",), of=columns.rolling, spreads=(BOTH_WAYS,),
                    reported=_rolling,
                )
            )  # fmt: skip
        return tuple(out)


class Roller(OfMotion):
    """Nothing that rolls has less inertia than none, or more than a hoop."""

    def is_admissible(self, trial: BodyTrial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return -0.02 < _rolling(trial, amplitudes)["k"] < 1.05


def _rolls(trial: BodyTrial) -> bool:
    support = trial.recording.support
    return support is not None and support.rolls and trial.slides


def _rolling(trial: BodyTrial, amplitudes: np.ndarray) -> dict[str, float]:
    # The acceleration falls with 1 + k; the amplitude is its slope at the stated k.
    stated = 1.0 + trial.recording.body.rolling
    return {"k": float(stated / max(1.0 - amplitudes[0] / stated, 1e-3) - 1.0)}


EFFECT = ObjectMass()
