"""45: camera latency."""

from __future__ import annotations

from samrl_core.diagnosis.effects.effect import Effect, Parameter
from samrl_core.diagnosis.effects.form import Form, Place
from samrl_core.diagnosis.effects.pose_forms import ShiftedStamps
from samrl_core.diagnosis.residuals.poses.pose_trial import PoseTrial

GRID_S = (0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256)


class CameraLatency(Effect[PoseTrial]):
    """An image shows what was there some time before its stamp."""

    family, number, title = "camera_latency", 45, "Camera latency"
    meaning = "Images are older than their stamps say."
    remedy = "Correct the stamps by the fitted time, or use the camera's hardware clock."
    formula = "image(t) = scene(t - T)"
    source = "30-100 ms over USB"
    acts_on = "reading"
    place_kind = "sensor"
    excitation = "the same path fast and slow; with two arms, motion of each alone"
    confounded_with = ("clock_offset", "command_delay")
    parameters = (Parameter("T", "s", 0.002, 0.4, "age of an image at its stamp"),)
    simulated = False

    def why_unobservable(self, trial: PoseTrial) -> str | None:
        return None if trial.shows_time else "needs stamped tracks of 5 Hz or more, taken in motion"

    def forms(self, trial: PoseTrial, place: Place) -> tuple[Form[PoseTrial], ...]:
        roles = tuple(arm.role for arm in trial.recording.arms)
        return (
            ShiftedStamps(
                place=place, amplitudes=("present",), shapes=tuple({"T": t} for t in GRID_S),
                refine={"T": (0.002, 0.4)}, parameter="T", sign=-1.0, reported=1.0, roles=roles,
            ),
        )  # fmt: skip


EFFECT = CameraLatency()
