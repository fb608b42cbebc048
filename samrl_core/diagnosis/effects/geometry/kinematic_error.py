"""29: kinematic error, of the tool's frame or of a link."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import SIX, SmallTransform, six_parameters
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial


class KinematicError(Effect[PoseTrial]):
    """A link, or what is fixed to the flange, has another geometry than stated."""

    family, number, title = "kinematic_error", 29, "Kinematic error"
    meaning = (
        "Link lengths, joint axes or the tool's frame differ from the model, while joints are on target."
    )
    remedy = "Correct the tool's frame or the link in the model by the fitted transform."
    formula = "frame = stated frame . exp(x, y, z, rx, ry, rz)"
    source = "0.1-2 mm and 0.05-0.5 degree"
    acts_on = "poses"
    place_kind = "link"
    excitation = "many poses that move every joint, with an outside measurement"
    confounded_with = ("hand_eye", "base_to_base", "encoder_offset")
    parameters = six_parameters(0.05, 0.1, "the frame")
    simulated = False

    def places(self, trial: PoseTrial) -> tuple[Place, ...]:
        """The target on its flange, and links between the first joint and the last of arms with joints.

        What is wrong before the first joint is a transform of the base, behind the last one of the flange.
        """
        names = [] if "target" not in trial.links else list(trial.names_of("body"))
        names += [f"link:{link}" for link in trial.inner_links]
        return tuple(Place.find(trial, name) for name in names)

    def why_unobservable(self, trial: PoseTrial) -> str | None:
        if "target" in trial.constants.free and not trial.inner_links:
            return "nobody stated where the target is on its flange; it was solved for"
        if not self.places(trial):
            return "needs joint positions and a URDF, or a target that an arm moves"
        return None

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        kind, _, name = place.name.partition(":")
        if kind == "body":
            if "target" in trial.constants.free:
                return ()
            return (SmallTransform(place=place, amplitudes=SIX, twists=lambda t: t.links["target"]),)
        side, joint = trial.inner_links[name]

        def twists(t: PoseTrial) -> np.ndarray:
            return t.chain.link_twists(side, joint)

        return (SmallTransform(place=place, amplitudes=SIX, twists=twists),)


EFFECT = KinematicError()
