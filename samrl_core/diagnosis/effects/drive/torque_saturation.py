"""15: torque saturation."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, lose_torque, unknown_torque
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, PresentForm, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

SOFT_KNEES = (4.0, 14.0)  # exponents p from which the search begins
SOFTNESS = (2.0, 40.0)  # from a very soft knee to what is nearly a clip
MOST_LIMITED = 0.75  # share of samples beyond the limit


class TorqueSaturation(DriveEffect):
    """The drive gives less than is asked for, above a limit that the model does not know."""

    family, number, title = "torque_saturation", 15, "Torque saturation"
    meaning = (
        "The drive's torque does not end at the model's limit: lower, fast moves are flattened; higher, they "
        "are not."
    )
    remedy = (
        "Set the model's effort limit to the fitted value, or slow the motion; check supply and drive limits."
    )
    formula = "tau = clip(u, -L, L), or u / (1 + |u / L|^p)^(1/p) with a soft knee"
    source = "drive limits by firmware or supply; soft: iron and supply give way before they end"
    excitation = "fast moves with high torques"
    confounded_with = ("torque_rate_limit", "actuator_gain")
    parameters = (Parameter("L", "N m", 1.0, 87.0, "torque limit"),)
    limits_motion = True
    renamed_shapes = ("p",)  # a knee as soft as may be is no limit

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        (joint,) = place.joints
        most = float(trial.strongest[joint])  # of all recordings: a slow one reaches no limit
        if most == 0.0:  # a joint that nothing drives has no limit
            return ()
        grid = tuple({"L": f * most} for f in (0.05, 0.12, 0.25, 0.4, 0.6, 0.75, 0.85, 0.92, 0.96))
        # From what is possible on: where the least limit fits best, something holds the joint.
        least = max(0.02 * most, min(unknown_torque(trial, joint), 0.9 * most))
        limits = {"L": (least, 1.3 * most)}
        soft = tuple({"L": f * most, "p": p} for p in SOFT_KNEES for f in (0.7, 0.85, 1.0, 1.1, 1.25))
        softness = {"L": (0.1 * most, 1.5 * most), "p": SOFTNESS}
        one = ("present",)
        forms = (
            DriveClip(name="drive", place=place, amplitudes=one, shapes=grid, refine=limits),
            SoftKnee(name="soft", place=place, amplitudes=one, shapes=soft, refine=softness),
        )
        if trial.equations.law is None:
            return forms
        return (
            *forms,
            ControllerClip(name="controller", place=place, amplitudes=one, shapes=grid, refine=limits),
        )


class LimitedTorque(PresentForm):
    """A torque that stays below a limit `L`."""

    @abstractmethod
    def asked(self, trial: Trial) -> np.ndarray | None:
        """Torque (F, J) that is asked for."""

    @abstractmethod
    def given(self, u: np.ndarray, shape: Shape) -> np.ndarray:
        """What of a torque (F,) comes out."""

    def lost(self, trial: Trial, shape: Shape) -> np.ndarray:
        """Missing torque (1, F)."""
        asked = self.asked(trial)
        assert asked is not None
        u = asked[:, self.joint]
        return (u - self.given(u, shape))[None]

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        # What a drive's torque may be off by anyway is no limit of it: then something holds the joint.
        if shape["L"] <= unknown_torque(trial, self.joint):
            return False
        # A drive that were in its limit nearly all of the time would not be a limit, but another law.
        asked = self.asked(trial)
        return asked is not None and bool(np.mean(np.abs(asked[:, self.joint]) > shape["L"]) <= MOST_LIMITED)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"L": shape["L"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # The simulator clips; a soft knee loses most where a clip at its asymptote begins to.
        return {"effort_limit": self.at_joints(trial, shape["L"], np.inf)}


class DriveClip(LimitedTorque):
    """The drive clips."""

    def asked(self, trial: Trial) -> np.ndarray | None:
        return None if trial.motion.raw_commanded is None else trial.motion.sure_torque

    def given(self, u: np.ndarray, shape: Shape) -> np.ndarray:
        return np.clip(u, -shape["L"], shape["L"])

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return lose_torque(trial, self.place, lambda _: self.lost(trial, shape))


class SoftKnee(LimitedTorque):
    """The drive gives way before it ends."""

    def asked(self, trial: Trial) -> np.ndarray | None:
        return None if trial.motion.raw_commanded is None else trial.motion.sure_torque

    def given(self, u: np.ndarray, shape: Shape) -> np.ndarray:
        return u / (1.0 + np.abs(u / shape["L"]) ** shape["p"]) ** (1.0 / shape["p"])

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return lose_torque(trial, self.place, lambda _: self.lost(trial, shape))


class ControllerClip(LimitedTorque):
    """The controller clips what it sends."""

    def asked(self, trial: Trial) -> np.ndarray | None:
        if trial.motion.computed:  # from the log, whose noise is in the residual too
            return trial.motion.sure_torque
        return trial.equations.law

    def given(self, u: np.ndarray, shape: Shape) -> np.ndarray:
        return np.clip(u, -shape["L"], shape["L"])

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return trial.controller(self.joint, self.lost(trial, shape))


EFFECT = TorqueSaturation()
