"""10: backlash."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import name_sizes, track_joints
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.transmission.deflection import Deflection, lacks_measured_torque
from samrl_core.diagnosis.residuals.basis_functions import play
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

GAPS = (2e-4, 8e-4, 3e-3, 1.2e-2)  # [rad]; a search that begins narrow does not reach a wide one
FLANK = 300.0  # [1/rad] stiffness of a tooth over effort limit, before it is searched
DAMPING_S = 0.002  # of stiffness
LEAST_GAP = 8e-5  # [rad] below it a gap is smaller than what encoders of arms resolve
TRACKED_GAP = 0.01  # [rad] of the play along a command; its own width is the amplitude
SPREAD = 0.01  # [rad] of the prior of a tracked gap
LEAST_OF_ALL = 0.003  # [rad] at each joint, where all are said to have a gap


class Backlash(Deflection):
    """Lost motion: the link is free within a gap, and jumps when the load changes sides."""

    family, number, title = "backlash", 10, "Backlash"
    meaning = "The gear has play: at load reversal the motor turns a little before the link follows."
    remedy = "Model the dead zone or preload the joint; if it exceeds the datasheet, have the gear serviced."
    formula = "q_link within q_motor +- b, free between, on a stiff flank beyond"
    source = "Nordin and Gutman 2002, Controlling mechanical systems with backlash"
    excitation = "load reversals, with both sides observed"
    experiment = "micro_reversals"
    confounded_with = ("joint_elasticity", "transmission_hysteresis", "coulomb_friction")
    contains = ("joint_elasticity",)  # the flank is a spring: with the gap gone that alone is left
    parameters = (Parameter("b", "rad", 0.0001, 0.02, "half width of the gap"),)

    def acts_on_arm(self, trial: Trial) -> bool:
        """Where only tracking is seen, also at all joints."""
        return "tracking" in trial.channels and trial.joints > 1

    def why_unobservable(self, trial: Trial) -> str | None:
        return None if "tracking" in trial.channels else lacks_measured_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """A gap of the model; without one, by the side of the load or by the way the command came."""
        if "tracking" in trial.channels:
            if trial.motion.u is None and trial.motion.tau is None:
                return (GapByDirection(name="direction", place=place, amplitudes=("b",)),)
            turns = tuple({"t0": f} for f in (0.1, 0.3, 1.0))
            return (GapByLoad(name="load", place=place, amplitudes=("b",), shapes=turns),)
        (joint,) = place.joints
        scale = float(trial.scale[joint])
        grid = tuple({"b": b, "K": FLANK * scale, "d": DAMPING_S * FLANK * scale} for b in GAPS)
        limits = {
            "b": (LEAST_GAP, 0.05),
            "K": (20.0 * scale, 5000.0 * scale),
            "d": (1e-3 * scale, 8.0 * scale),
        }
        return (FreeGap(name="free", place=place, amplitudes=("present",), shapes=grid, refine=limits),)


class FreeGap(Form):
    """The link is free within the gap, and swings on a flank beyond."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        angle = trial.motion.reduce(trial.sprung(self.joint, shape["K"], shape["d"], shape["b"]))
        return trial.link(trial.deflection(self.joint, angle[None]))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.ones(1), np.full(1, 0.05)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"b": shape["b"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {
            "backlash": self.at_joints(trial, shape["b"]),
            "joint_stiffness": self.at_joints(trial, shape["K"], np.inf),
            "joint_damping": self.at_joints(trial, shape["d"]),
        }


class TrackedGap(Form):
    """A gap as a servo's tracking error shows it, where no torque model exists: at one joint, or at all."""

    signed: ClassVar[bool]  # whether the sign of the amplitude means anything

    @abstractmethod
    def side(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        """Side of the gap (N,) on which the link lies, -1..1."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        return track_joints(trial, self.place, lambda j: self.side(trial, j, shape)[None])

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.place.joints)
        return np.zeros(count), np.full(count, SPREAD)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Gaps are positive; those of all joints beyond what servos let stand."""
        sizes = amplitudes if self.signed else np.abs(amplitudes)
        return bool(np.all(sizes > (LEAST_OF_ALL if len(sizes) > 1 else 0.0)))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "b", np.abs(amplitudes))


class GapByLoad(TrackedGap):
    """By the side of the load; `t0` is the share of its usual span in which the link changes sides."""

    signed = False  # the sign of a load register is a convention of the drive

    def side(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        load = trial.motion.tau if trial.motion.tau is not None else trial.motion.u
        assert load is not None
        still = trial.settled[:, joint] > 0.5  # moves need more than loads
        low, high = np.quantile(load[still, joint] if np.any(still) else load[:, joint], [0.05, 0.95])
        side = (load[:, joint] - 0.5 * (high + low)) / (0.5 * (high - low) + 1e-12)
        return np.tanh(side / shape["t0"]) / np.tanh(1.0 / shape["t0"])


class GapByDirection(TrackedGap):
    """By the way the command came."""

    signed = True

    def side(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        command = trial.motion.command
        assert command is not None and command.position is not None
        path = trial.motion.reduce(command.position)[:, joint]
        return (path - play(path, TRACKED_GAP)) / TRACKED_GAP


EFFECT = Backlash()
