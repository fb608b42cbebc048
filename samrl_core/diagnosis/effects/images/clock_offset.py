"""46: clock offset, as images show it."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.image_forms import AddedColumns
from samrl_core.diagnosis.residuals.images.image_trial import ImageTrial


class ClockOffsetByImages(Effect[ImageTrial]):
    """One arm's clock is ahead of the camera's or behind it."""

    family, number, title = "clock_offset", 46, "Clock offset or drift"
    meaning = "Two devices' clocks disagree."
    remedy = "Synchronise the clocks (PTP, NTP) or correct the stamps when reading."
    formula = "arm's stamp = camera's stamp + o"
    source = "0-20 ms between hosts; seconds without synchronisation"
    acts_on = "reading"
    place_kind = "arm"
    excitation = "motion of each arm alone"
    confounded_with = ("camera_latency",)
    parameters = (Parameter("o", "s", -1.5, 1.5, "by which the arm's stamps are ahead"),)
    simulated = False

    def why_unobservable(self, trial: ImageTrial) -> str | None:
        return None if trial.moves("camera") or trial.moves("tool") else "needs images taken in motion"

    def places(self, trial: ImageTrial) -> tuple[Place, ...]:
        """Arms that move in the images."""
        moving = [a for a in ("camera", "tool") if trial.moves(a)]
        return tuple(Place.find(trial, f"arm:{a}_arm") for a in moving)

    def forms(self, trial: ImageTrial, place: Place) -> tuple[Form[ImageTrial], ...]:
        arm = place.name.partition(":")[2].removesuffix("_arm")
        return (
            AddedColumns(
                place=place,
                amplitudes=("o",),
                columns_of=(f"{arm}_late",),
                spreads=(0.02,),
                sign=-1.0,
            ),
        )


EFFECT = ClockOffsetByImages()
