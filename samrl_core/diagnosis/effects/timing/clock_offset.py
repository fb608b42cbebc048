"""46: clock offset or drift."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import ShiftedStamps
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial

GRID_S = (0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256, 0.512, 1.024)
DRIFT_S = 20.0  # of a recording from which on a drift is looked for


class ClockOffset(Effect[PoseTrial]):
    """An arm's clock is ahead of the camera's or behind it, and may run at another rate."""

    family, number, title = "clock_offset", 46, "Clock offset or drift"
    meaning = "Two devices' clocks disagree, and more so with time."
    remedy = "Synchronise the clocks (PTP, NTP) or correct the stamps when reading."
    formula = "arm's stamp = camera's stamp + o + e t"
    source = "0-20 ms and 1-50 ppm between hosts; seconds without synchronisation"
    acts_on = "reading"
    place_kind = "arm"
    excitation = "a long recording with quick motion at its beginning and its end"
    confounded_with = ("camera_latency",)
    parameters = (
        Parameter("o", "s", -1.5, 1.5, "by which the arm's stamps are ahead when the recording begins"),
        Parameter("drift", "1", -2e-3, 2e-3, "seconds per second by which they run ahead"),
    )
    renamed_shapes = ("T",)
    simulated = False

    def why_unobservable(self, trial: PoseTrial) -> str | None:
        return None if trial.shows_time else "needs stamped tracks of 5 Hz or more, taken in motion"

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        roles = (place.name.partition(":")[2],)
        shapes = tuple({"T": t} for t in GRID_S if t < 0.2 * trial.duration)
        out = []
        for name, sign in (("ahead", 1.0), ("behind", -1.0)):
            for drifts in (False, True) if trial.duration > DRIFT_S else (False,):
                out.append(
                    ShiftedStamps(
                        name=f"{name}, drifting" if drifts else name, place=place,
                        amplitudes=("present", "drift") if drifts else ("present",), shapes=shapes,
                        refine={"T": (0.002, 1.5)}, parameter="o", sign=sign, reported=sign, roles=roles,
                        drifts=drifts,
                    )
                )  # fmt: skip
        return tuple(out)


EFFECT = ClockOffset()
