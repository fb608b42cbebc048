"""53: dead band of the controller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_law
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, PresentForm, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial, add

SHARES = (0.05, 0.15, 0.4, 1.0)  # of the usual error, from which the search begins
LEAST, MOST = 0.01, 5.0  # of the same: its bounds


class DeadBand(Effect):
    """The controller lets an error stand that it is described to correct."""

    family, number, title = "dead_band", 53, "Dead band of the controller"
    meaning = "The controller does nothing about errors below a width, so the joint rests off target."
    remedy = "Set the firmware's dead band (compliance margin) to the described one, or describe it."
    formula = "e -> e - w sgn(e) where |e| > w, else 0"
    source = "ROBOTIS e-manual, AX-12: compliance margin, in steps of 0.29 deg; Feetech STS: dead zone"
    acts_on = "command"
    excitation = "slow motions and rests, errors of both signs"
    confounded_with = ("coulomb_friction", "backlash", "controller_gain")
    parameters = (Parameter("width", "rad", 0.0005, 0.1, "half width, beyond the described one"),)
    prior_cost = 2.0  # most controllers have none

    def why_unobservable(self, trial: Trial) -> str | None:
        """Needs a described position loop."""
        controller = trial.recording.arm.controller
        if not trial.shows_controller or controller is None:
            return lacks_law(trial, "needs the command, the described controller, and what came of it")
        if not np.any(controller.stiffness > 0) or np.any(np.asarray(controller.law.pole_pitch) > 0):
            return "the described controller has no position loop"
        return None

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """Widths in shares of the errors that occurred."""
        usual = _usual_error(trial, place)
        grid = tuple({"width": share * usual} for share in SHARES)
        limits = {"width": (LEAST * usual, MOST * usual)}
        return (WiderBand(place=place, amplitudes=("present",), shapes=grid, refine=limits),)


class WiderBand(PresentForm):
    """The spring's torque less what a wider band leaves of it."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        motion, controller = trial.motion, trial.recording.arm.controller
        assert controller is not None
        band = controller.law.of_joints("dead_band", trial.joints) + shape["width"]
        wider = replace(controller, law=replace(controller.law, dead_band=band))
        lost = motion.described_law.total - motion.law(described=wider).total
        return add(*(trial.controller(j, lost[:, [j]].T) for j in self.place.joints))

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        return shape["width"] < float(np.max(_errors(trial)[:, self.joint]))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"width": shape["width"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {"dead_band": self.at_joints(trial, shape["width"])}


def _errors(trial: Trial) -> np.ndarray:
    command, position = trial.motion.command, trial.motion.raw_position
    assert command is not None and command.position is not None and position is not None
    return np.abs(command.position - position)


def _usual_error(trial: Trial, place: Place) -> float:
    return max(float(np.quantile(_errors(trial)[:, list(place.joints)], 0.8)), 1e-6)


EFFECT = DeadBand()
