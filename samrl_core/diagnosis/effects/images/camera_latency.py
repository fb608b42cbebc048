"""45: camera latency, as images show it."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import AddedColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class CameraLatencyByImages(Effect[ImageTrial]):
    """An image shows what was there some time before its stamp."""

    family, number, title = "camera_latency", 45, "Camera latency"
    meaning = "Images are older than their stamps say."
    remedy = "Correct the stamps by the fitted time, or use the camera's hardware clock."
    formula = "image(t) = scene(t - T)"
    source = "30-100 ms over USB"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "the same path fast and slow; motion of each arm alone"
    confounded_with = ("clock_offset", "command_delay")
    parameters = (Parameter("T", "s", -0.4, 0.4, "age of an image at its stamp"),)
    simulated = False

    def why_unobservable(self, trial: ImageTrial) -> str | None:
        return None if trial.moves("camera") or trial.moves("tool") else "needs images taken in motion"

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        return (
            AddedColumns(
                place=place,
                amplitudes=("T",),
                columns_of=("camera_late", "tool_late"),
                spreads=(0.02,),
            ),
        )


EFFECT = CameraLatencyByImages()
