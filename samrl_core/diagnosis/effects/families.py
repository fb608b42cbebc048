"""Bases of effects that differ only in their formula."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Shape
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial, add


class DriveTorque(Effect):
    """A torque lost between commanded effort and torque sensor of one joint."""

    acts_on = "dynamics"

    @abstractmethod
    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """Lost torque (p, F) per unit amplitude at full rate."""

    @abstractmethod
    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """Prior standard deviations (p,) of the amplitudes around zero."""

    def unobservable(self, trial: Trial) -> str | None:
        """Needs the commanded effort."""
        if not ({"drive", "dynamics"} & set(trial.channels)):
            return "needs the commanded effort and a dynamic model"
        return None

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """Lost torque in the drive equation."""
        parts = [trial.drive(j, self.torque(trial, j, form, shape)) for j in self.joints_at(trial, place)]
        return add(*parts)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on no effect."""
        spread = self.spread(trial, self.joints_at(trial, place)[0], form, shape)
        return np.zeros(len(spread)), spread


class Deflection(Effect):
    """The link trails the joint's reading by an angle that depends on the transmitted torque."""

    acts_on = "dynamics"

    @abstractmethod
    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        """Deflection (p, N) per unit amplitude [rad] under the transmitted torque (N,) [N m]."""

    def unobservable(self, trial: Trial) -> str | None:
        """Needs torques."""
        if trial.rigid is None or not ({"link", "dynamics"} & set(trial.channels)):
            has_load = "tracking" in trial.channels and trial.motion.u is not None
            return None if has_load else "needs a torque and a dynamic model"
        return None

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """Motor-side reading: the link is where its inertia and weight are felt."""
        (joint,) = self.joints_at(trial, place)
        if "tracking" in trial.channels:
            assert trial.motion.u is not None
            return trial.tracking(joint, self.angle(trial, joint, form, shape, trial.motion.u[:, joint]))
        angle = self.angle(trial, joint, form, shape, trial.transmitted[:, joint])
        return trial.link(trial.deflection(joint, angle))


class FixedResponse(Effect):
    """An effect that is there or not: its amplitude is one, and only its shape is unknown.

    A small freedom of the amplitude absorbs that a real filter is not exactly of first order.
    """

    freedom = 0.05

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on one."""
        return np.ones(1), np.full(1, self.freedom)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Must be present."""
        return bool(amplitudes[0] > 0.5)


def single(
    amplitudes: tuple[str, ...], shapes: tuple[Shape, ...] = ({},), **refine: tuple[float, float]
) -> tuple[Form, ...]:
    """The only form of an effect."""
    return (Form("", amplitudes, shapes, refine),)
