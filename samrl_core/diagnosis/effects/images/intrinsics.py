"""40: camera intrinsics."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import ImageColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class IntrinsicsByImages(Effect[ImageTrial]):
    """Focal lengths or the image's centre differ from the calibration."""

    family, number, title = "intrinsics", 40, "Camera intrinsics"
    meaning = "Focal length or image centre differ from the calibration."
    remedy = "Calibrate the camera again at the resolution that is in use."
    formula = "u = (1 + fx) f x/z + c + cx width"
    source = "focal length +-0.5 %, centre +-3 px"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "objects across the whole image at two distances"
    confounded_with = ("hand_eye", "depth_scale", "lens_distortion")
    parameters = (
        Parameter("fx", "1", -0.1, 0.1, "focal length along u, share of it"),
        Parameter("fy", "1", -0.1, 0.1, "focal length along v, share of it"),
        Parameter("cx", "1", -0.1, 0.1, "principal point, share of the width"),
        Parameter("cy", "1", -0.1, 0.1, "principal point, share of the height"),
    )
    simulated = False
    forms_may_be_one = True

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        focal = ImageColumns(
            name="focal length",
            place=place,
            amplitudes=("fx", "fy"),
            columns_of=("focal",),
            spreads=(0.01, 0.01),
        )
        centre = ImageColumns(
            name="centre", place=place, amplitudes=("cx", "cy"), columns_of=("centre",), spreads=(0.01, 0.01)
        )
        both = ImageColumns(
            name="both",
            place=place,
            amplitudes=("fx", "fy", "cx", "cy"),
            columns_of=("focal", "centre"),
            spreads=(0.01,) * 4,
        )
        return (focal, centre, both)


EFFECT = IntrinsicsByImages()
