"""49: geometry of the object: a target of another size."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import TargetSize
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial


class ObjectGeometry(Effect[PoseTrial]):
    """The target is larger or smaller than stated, so that it seems nearer or farther."""

    family, number, title = "object_geometry", 49, "Geometry of the object"
    meaning = "The object's size differs from its description: a printed target was scaled, for example."
    remedy = "Measure the printed target and state its real size to the detector."
    formula = "position seen = position / (1 + s)"
    source = "printers scale by 1-5 %; a size stated wrongly is off by any factor"
    acts_on = "poses"
    place_kind = "body"
    excitation = "two distances at least"
    confounded_with = ("intrinsics", "depth_scale", "hand_eye")
    # Detectors take a size that was typed in: it may be off by any factor.
    parameters = (Parameter("s", "1", -0.1, 0.1, "by which the target is larger", bounded=False),)
    simulated = False

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        return (TargetSize(place=place, amplitudes=("s",)),)


EFFECT = ObjectGeometry()
