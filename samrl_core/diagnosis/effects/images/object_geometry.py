"""49: geometry of the object: it is larger or smaller than drawn."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class ObjectGeometryByImages(Effect[ImageTrial]):
    """The task's object has another size than its mesh."""

    family, number, title = "object_geometry", 49, "Geometry of the object"
    meaning = "The object's size differs from its description: a printed part was scaled, for example."
    remedy = "Measure the part and correct its mesh."
    formula = "points of the object = (1 + s) stated points"
    source = "printers scale by 1-5 %"
    acts_on = "dynamics"
    place_kind = "body"
    excitation = "outlines and top of the object from several sides"
    confounded_with = ("intrinsics", "depth_scale", "hand_eye")
    parameters = (Parameter("s", "1", -0.3, 0.3, "by which the object is larger"),)
    simulated = False

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (ImageColumns(place=place, amplitudes=("s",), columns_of=("object_scale",), spreads=(0.03,)),)


EFFECT = ObjectGeometryByImages()
