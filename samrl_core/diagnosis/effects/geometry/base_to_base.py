"""30: transform between the bases."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import SIX, SmallTransform, six_parameters
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial


class BaseToBase(Effect[PoseTrial]):
    """The arms do not stand to each other, or the target to the base, as stated."""

    family, number, title = "base_to_base", 30, "Transform between the bases"
    meaning = "The two arms, or the base and a still target, do not stand to each other as the model says."
    remedy = "Multiply the stated transform by the fitted one, or measure it again from several poses."
    formula = "base = stated base . exp(x, y, z, rx, ry, rz)"
    source = "0.5-10 mm and 0.05-1 degree"
    acts_on = "poses"
    place_kind = "cell"
    excitation = "views from many poses of the camera; its own motion tells it from the hand-eye calibration"
    confounded_with = ("hand_eye", "kinematic_error", "encoder_offset")
    parameters = six_parameters(0.05, 0.1, "the second base")
    simulated = False

    def why_unobservable(self, trial: PoseTrial) -> str | None:
        if "base" not in trial.links:
            return "there is no second base: camera and target are framed by one arm"
        if "base" in trial.constants.free:
            return "nobody stated how the bases stand; it was solved for"
        return None

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        return (SmallTransform(place=place, amplitudes=SIX, twists=lambda t: t.links["base"]),)


EFFECT = BaseToBase()
