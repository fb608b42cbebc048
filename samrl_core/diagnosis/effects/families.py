"""Bases of effects that differ only in their formula."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Shape
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial

COMMON = 2.0 / 3.0  # of the joints that must show what is said of all
BEYOND = 3.0  # tolerances; a background of twice the tolerances is none


class DriveTorque(Effect):
    """A torque lost between commanded effort and torque sensor of one joint."""

    acts_on = "dynamics"
    at_every_joint: ClassVar[bool] = False  # may also act at all joints of an arm, each with its own size

    def places(self, trial: Trial) -> tuple[str, ...]:
        """Each joint; for some families also the arm: the same formula at every joint."""
        every = self.at_every_joint and trial.joints > 1 and "tracking" not in trial.channels
        return super().places(trial) + ((f"arm:{trial.recording.arm.role}",) if every else ())

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
        """Lost torque in the drive equation; rows of the first joint, then of the second, ..."""
        joints = self.joints_at(trial, place)
        out: Columns = {}
        for i, j in enumerate(joints):
            for key, rows in trial.drive(j, self.torque(trial, j, form, shape)).items():
                out[key] = np.zeros((len(rows) * len(joints), rows.shape[1]))
                out[key][i * len(rows) : (i + 1) * len(rows)] = rows
        return out

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        """Centred on no effect."""
        joints = self.joints_at(trial, place)
        spread = np.concatenate([self.spread(trial, j, form, shape) for j in joints])
        return np.zeros(len(spread)), spread

    def beyond_nominal(self, trial: Trial, joint: int) -> float:
        """Size from which a joint counts as having the effect, when all of them are said to have it."""
        return 0.0

    def positive(self, trial: Trial, place: str, amplitudes: np.ndarray) -> bool:
        """Sizes (J,) of a family with one amplitude per joint: positive, and at an arm's joints common.

        Common: beyond the tolerances at two joints in three, and against the motion at none. So a single bad
        joint among good ones is never called the arm's.
        """
        joints = self.joints_at(trial, place)
        if len(joints) == 1:
            return bool(amplitudes[0] > 0)
        least = np.array([self.beyond_nominal(trial, j) for j in joints])
        common = np.count_nonzero(amplitudes > least) >= max(2, COMMON * len(joints))
        return bool(common and np.min(amplitudes) > -np.median(least))

    def sizes(self, trial: Trial, place: str, name: str, amplitudes: np.ndarray) -> dict[str, float]:
        """Parameters by name; of an arm with the joint's name in brackets."""
        joints = self.joints_at(trial, place)
        if len(joints) == 1:
            return {name: float(amplitudes[0])}
        names = trial.recording.arm.joints
        return {f"{name}[{names[j]}]": float(a) for j, a in zip(joints, amplitudes, strict=True)}


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
