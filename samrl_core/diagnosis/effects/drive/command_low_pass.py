"""17: command low-pass."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.drive.late_response import LateForm, LateResponse, late_sides
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import low_passed, resonant
from samrl_core.diagnosis.residuals.trial import Trial

GRID = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # [Hz]
TRACKED_GRID = (0.5, 1.0, 2.0, 4.0, 8.0)  # [Hz] of servos that only log where they are


class CommandLowPass(LateResponse):
    """A filter of first or second order between what is commanded and what is done."""

    family, number, title = "command_low_pass", 17, "Low-pass filter on the command"
    meaning = "A filter between command and drive smooths and delays fast changes."
    remedy = "Find the filter in controller or drive and model it with its cut-off, or raise the cut-off."
    formula = "x' = 2 pi fc (x_in - x), or Butterworth of second order: x'' = w (w (x_in - x) - sqrt(2) x')"
    source = "libfranka: first order, 100 Hz by default, up to 1000 Hz; drives: second-order torque filters"
    excitation = "chirp to 10-30 Hz"
    experiment = "chirp"
    confounded_with = ("command_delay", "joint_elasticity", "torque_rate_limit")
    parameters = (Parameter("fc", "Hz", 0.5, 100.0, "cutoff frequency, at -3 dB"),)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            grid, limits = tuple({"fc": f} for f in TRACKED_GRID), {"fc": (1e-3, 50.0)}
            return (FirstOrder(name="tracking", place=place, side="tracking", shapes=grid, refine=limits),)
        # Filters faster than a third of the sampling rate are lost in what is aliased.
        low, high = 0.2, min(200.0, trial.motion.rate / 3.0)
        grid, limits = tuple({"fc": f} for f in GRID if low < f < high), {"fc": (low, high)}
        return tuple(
            make(name=f"{side}{suffix}", place=place, side=side, shapes=grid, refine=limits)
            for side in late_sides(trial)
            for make, suffix in ((FirstOrder, ""), (SecondOrder, " second order"))
        )


class FirstOrder(LateForm):
    """A low-pass of first order; on a command it runs at the controller's period, within samples of a log."""

    def _ticks(self, trial: Trial) -> int:
        """Of the filter per sample."""
        controller = trial.recording.arm.controller
        if self.side != "command" or controller is None:
            return 1
        return max(1, round(1.0 / (trial.motion.rate * controller.period_s)))

    def late(self, trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
        return low_passed(x, shape["fc"], trial.motion.rate, self._ticks(trial))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"fc": shape["fc"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if self.side == "tracking":
            return None
        return {f"{self.side}_cutoff": self.at_joints(trial, shape["fc"], np.inf)}


class SecondOrder(LateForm):
    """A Butterworth low-pass of second order; the simulator's filters are of first order."""

    def late(self, trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
        return resonant(x, shape["fc"], np.sqrt(0.5), 1.0 / trial.motion.rate)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"fc": shape["fc"]}


EFFECT = CommandLowPass()
