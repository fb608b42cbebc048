"""26: tilt, of the support or of the track's frame against gravity."""

from __future__ import annotations

from samrl_core.diagnosis.effects.body_forms import OfMotion
from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.residuals.bodies import columns
from samrl_core.diagnosis.residuals.bodies.body_trial import BodyTrial


class TiltByBodies(Effect[BodyTrial]):
    """Gravity pulls a free body from elsewhere than stated, or its support leans."""

    family, number, title = "base_tilt", 26, "Tilt of the base"
    meaning = (
        "What counts as level is not: gravity pulls bodies from another direction than the model thinks."
    )
    remedy = "Level the table or the camera, or set gravity's direction in the model to the fitted one."
    formula = "gravity, or the support's normal, rotated by (ax, ay) about two axes across it"
    source = "tables and tripods: 0-3 degrees"
    acts_on = "contact"
    place_kind = "cell"
    excitation = "slides or tosses in two directions"
    confounded_with = ("contact_friction",)
    parameters = (
        Parameter("ax", "rad", -0.1, 0.1, "about the track's x, laid across it"),
        Parameter("ay", "rad", -0.1, 0.1, "about the axis left of that, seen from above: y where z is up"),
    )
    simulated = False

    def forms(self, trial: BodyTrial, place: Place) -> tuple[Form[BodyTrial], ...]:
        names, spreads = ("ax", "ay"), (0.03, 0.03)
        gravity = OfMotion(
            name="gravity", place=place, amplitudes=names, of=columns.gravity_tilt, spreads=spreads
        )
        # One number less where everything goes one way: then it may do what friction does.
        axis = columns.across_the_way(trial)
        one = OfMotion(
            name="one way", place=place, amplitudes=("a",), spreads=spreads[:1],
            of=lambda t: columns.along(columns.gravity_tilt(t), axis),
            reported=lambda t, a: {n: float(a[0] * x) for n, x in zip(names, axis, strict=True)},
        )  # fmt: skip
        few = (gravity, one) if columns.goes_one_way(trial) else (gravity,)
        if not trial.slides or not trial.sees_normal:
            return few
        support = OfMotion(
            name="support", place=place, amplitudes=names, of=columns.support_tilt, spreads=spreads
        )
        return (*few, support)


EFFECT = TiltByBodies()
