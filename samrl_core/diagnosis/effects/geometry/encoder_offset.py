"""21: encoder offset, as a camera sees it."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import OneNumber
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial


class EncoderOffsetByPoses(Effect[PoseTrial]):
    """A joint reads a constant angle too much; the target is seen elsewhere than the arm says."""

    family, number, title = "encoder_offset", 21, "Encoder offset"
    meaning = "The joint's zero is off by a constant angle: it believes it stands where it does not."
    remedy = "Recalibrate the joint's zero; confirm with an outside measurement of the tool's position."
    formula = "q_read = q + e"
    source = "0.001-0.02 rad; PACE bounds 0.1 rad"
    acts_on = "reading"
    excitation = "many poses that move the joints before and behind it"
    confounded_with = ("hand_eye", "base_to_base", "kinematic_error")
    parameters = (Parameter("e", "rad", 0.001, 0.1, "offset of the reading"),)
    simulated = False

    def why_unobservable(self, trial: PoseTrial) -> str | None:
        return None if trial.names_of("joint") else "needs joint positions and a URDF"

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        side, joint = trial.joint_of(place.name)

        def twist(t: PoseTrial) -> np.ndarray:
            arm = t.chain.arms[side]
            assert arm is not None
            return -t.joint_twists[arm.role][joint]  # it stands behind what it reads

        return (OneNumber(place=place, amplitudes=("e",), twist=twist, spread=0.03),)


EFFECT = EncoderOffsetByPoses()
