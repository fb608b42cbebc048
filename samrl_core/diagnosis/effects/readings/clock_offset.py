"""46: clock offset or drift, by stamps alone."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.reading_forms import Polynomial, needs
from samrl_core.diagnosis.residuals.readings.reading_trial import ReadingTrial


class ClockOffsetByStamps(Effect[ReadingTrial]):
    """A device's clock is ahead of the reference or behind it, and may run at another rate."""

    family, number, title = "clock_offset", 46, "Clock offset or drift"
    meaning = "Two devices' clocks disagree, and more so with time."
    remedy = "Synchronise the clocks (PTP, NTP) or correct the stamps when reading."
    formula = "stamp = reference + o + e t"
    source = "0-20 ms and 1-50 ppm between hosts; seconds without synchronisation"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "events that both clocks stamp, over minutes"
    confounded_with = ("camera_latency",)
    parameters = (
        Parameter("o", "s", -1e4, 1e4, "by which the device is ahead when the recording begins"),
        Parameter("drift", "1", -2e-3, 2e-3, "seconds per second by which it runs ahead"),
    )
    simulated = False

    def why_unobservable(self, trial: ReadingTrial) -> str | None:
        return needs(trial, "stamp")

    def forms(self, trial: ReadingTrial, place: Place) -> tuple[Form[ReadingTrial], ...]:
        offset = Polynomial(name="offset", place=place, amplitudes=("o",), powers=(0,), spreads=(0.1,))
        far = Polynomial(name="far apart", place=place, amplitudes=("o",), powers=(0,), spreads=(100.0,))
        drift = Polynomial(name="drift", place=place, amplitudes=("drift",), powers=(1,), spreads=(5e-5,))
        fast = Polynomial(  # a rate that was stated wrongly, as 30 Hz for 29.97
            name="fast drift", place=place, amplitudes=("drift",), powers=(1,), spreads=(5e-4,), surprise=1.0
        )
        both = Polynomial(
            name="offset and drift",
            place=place,
            amplitudes=("o", "drift"),
            powers=(0, 1),
            spreads=(0.1, 5e-5),
        )
        far_both = Polynomial(
            name="far apart, drifting", place=place, amplitudes=("o", "drift"), powers=(0, 1),
            spreads=(100.0, 5e-4),
        )  # fmt: skip
        return (offset, far, drift, fast, both, far_both)


EFFECT = ClockOffsetByStamps()
