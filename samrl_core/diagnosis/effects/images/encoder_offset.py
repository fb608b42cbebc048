"""21: encoder offset, as images show it."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ZeroOfJoint
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class EncoderOffsetByImages(Effect[ImageTrial]):
    """A joint reads a constant angle too much; camera or tool is seen elsewhere than the arm says."""

    family, number, title = "encoder_offset", 21, "Encoder offset"
    meaning = "The joint's zero is off by a constant angle: it believes it stands where it does not."
    remedy = "Recalibrate the joint's zero; confirm with an outside measurement of the tool's position."
    formula = "q_read = q + e"
    source = "0.001-0.02 rad; PACE bounds 0.1 rad"
    acts_on = "reading"
    place_kind = "joint"
    excitation = "many poses that move the joints before and behind it"
    confounded_with = ("hand_eye", "base_to_base")
    parameters = (Parameter("e", "rad", -0.1, 0.1, "offset of the reading"),)
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        arm, index = trial.joint_of(place.name)
        return (
            ZeroOfJoint(
                place=place,
                amplitudes=("e",),
                columns_of=(f"{arm}_zeros",),
                spreads=(0.004,),
                index=index,
            ),
        )


EFFECT = EncoderOffsetByImages()
