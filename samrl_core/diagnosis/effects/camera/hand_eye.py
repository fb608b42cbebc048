"""39: hand-eye calibration."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import SIX, SmallTransform, six_parameters
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial


class HandEye(Effect[PoseTrial]):
    """The camera sits elsewhere on what carries it than is stated."""

    family, number, title = "hand_eye", 39, "Hand-eye calibration"
    meaning = "The camera does not sit on the flange (or stand in the cell) where the model says."
    remedy = "Multiply the stated transform by the fitted one, or calibrate again; check the camera's screws."
    formula = "camera = stated camera . exp(x, y, z, rx, ry, rz)"
    source = "0.5-5 mm and 0.05-1 degree; 2 cm after a knock"
    acts_on = "poses"
    place_kind = "sensor"
    excitation = "ten or more poses of the camera, turned about two axes at least"
    confounded_with = ("base_to_base", "intrinsics", "kinematic_error", "encoder_offset")
    parameters = six_parameters(0.05, 0.1, "the camera")
    simulated = False

    def why_unobservable(self, trial: PoseTrial) -> str | None:
        if "camera" in trial.constants.free:
            return "nobody stated where the camera is; it was solved for"
        return None

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        return (SmallTransform(place=place, amplitudes=SIX, twists=lambda t: t.links["camera"]),)


EFFECT = HandEye()
