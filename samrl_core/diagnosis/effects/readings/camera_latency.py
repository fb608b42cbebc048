"""45: camera latency, by stamps alone."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.reading_forms import Polynomial, needs
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial


class LatencyByStamps(Effect[ReadingTrial]):
    """What a device reports of an event carries a later stamp."""

    family, number, title = "camera_latency", 45, "Camera latency"
    meaning = "Images are older than their stamps say."
    remedy = "Correct the stamps by the fitted time, or use the camera's hardware clock."
    formula = "stamp = time of the event + T"
    source = "30-100 ms over USB"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "events that both clocks stamp, over minutes"
    confounded_with = ("clock_offset",)
    parameters = (Parameter("T", "s", 0.0, 0.4, "by which stamps are late"),)
    simulated = False

    def why_unobservable(self, trial: ReadingTrial) -> str | None:
        return needs(trial, "stamp")

    def forms(self, trial: ReadingTrial, place: Place) -> tuple[Form[ReadingTrial], ...]:
        return (Late(place=place, amplitudes=("T",), powers=(0,), spreads=(0.1,)),)


class Late(Polynomial):
    """Never early, and no longer than an image is kept."""

    def is_admissible(self, trial: ReadingTrial, shape: dict[str, float], amplitudes: np.ndarray) -> bool:
        return bool(0.0 < amplitudes[0] < 0.6)


EFFECT = LatencyByStamps()
