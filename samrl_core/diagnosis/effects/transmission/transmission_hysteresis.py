"""12: transmission hysteresis."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.transmission.deflection import Deflection, TwistForm
from samrl_core.diagnosis.effects.transmission.joint_elasticity import STIFFEST
from samrl_core.diagnosis.residuals.basis_functions import bristle, rubbing_spring
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_LOOP = 1e-4  # [rad] less is below what is known of drives
LEAST_TURN = 0.2  # of the spring's stiffness, that a turn must add: less is a plain spring


class TransmissionHysteresis(Deflection):
    """The joint twists under torque with a loop that does not depend on the rate."""

    family, number, title = "transmission_hysteresis", 12, "Transmission hysteresis"
    meaning = "The transmission's twist depends on the load's history and traces a loop at any speed."
    remedy = "Add a hysteresis state to the transmission, or approach targets always from one side."
    formula = "tau = K x + ts z(x); or x = a z, dz = dtau / ts (1 - z sgn dtau), with x = q_motor - q_link"
    source = "Bouc-Wen family; harmonic drives: Tjahjowidodo et al. 2013"
    excitation = "quasi-static load cycles"
    experiment = "micro_reversals"
    confounded_with = ("presliding", "backlash", "joint_elasticity")
    parameters = (
        Parameter("a", "rad", 0.0001, 0.005, "half height of the loop"),
        Parameter("ts", "N m", 0.5, 30.0, "torque of the loop, or over which it builds up"),
        Parameter("K", "N m/rad", 500.0, 50000.0, "stiffness of a joint that also twists, while it slides"),
    )
    prior_cost = 10.0  # it holds a plain spring as a special case: its loop must earn two more shapes

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """A loop of the angle alone, and a spring with friction beside it."""
        (joint,) = place.joints
        seen = trial.motion.u if trial.motion.u is not None else trial.motion.q
        span = max(float(np.ptp(seen[:, joint])), 1e-3)
        loops = tuple({"ts": f * span} for f in (0.05, 0.2))
        grid = tuple({"ts": t * span, "y": y * span} for t in (0.1, 0.3) for y in (0.04, 0.12, 0.35))
        # a slider that does not turn round within the torques that were seen is a part of the spring
        limits = {"ts": (0.01 * span, 0.5 * span), "y": (0.005 * span, 0.5 * span)}
        return (
            Loop(place=place, amplitudes=("a",), shapes=loops, refine={"ts": (0.01 * span, span)}),
            RubbingSpring(name="spring", place=place, amplitudes=("compliance",), shapes=grid, refine=limits),
        )


class Loop(TwistForm):
    """A loop of the angle alone."""

    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        return bristle(torque, shape["ts"])[None]

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.005)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > LEAST_LOOP)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"a": float(amplitudes[0]), "ts": shape["ts"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if "tracking" in trial.channels:
            return None
        return {
            "hysteresis_amplitude": self.at_joints(trial, amplitudes[0]),
            "hysteresis_torque": self.at_joints(trial, shape["ts"], 1.0),
        }


class RubbingSpring(TwistForm):
    """A spring with friction beside it."""

    by_turns = True

    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        twist = rubbing_spring(torque, shape["ts"], shape["y"])
        return (twist - np.mean(twist) * (1.0 if "tracking" in trial.channels else 0.0))[None]

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.02 / trial.scale[self.joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        found = self.parameters(trial, shape, amplitudes)
        turns = found["ts"] > LEAST_TURN * shape["y"]
        return bool(found["a"] > LEAST_LOOP and turns and found["K"] < STIFFEST * trial.scale[self.joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        compliance = float(amplitudes[0])
        return {"a": compliance * shape["ts"], "ts": shape["ts"], "K": 1.0 / max(abs(compliance), 1e-12)}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if "tracking" in trial.channels:
            return None
        # The simulator's spring does not rub.
        return {"joint_stiffness": self.at_joints(trial, self.line(trial, shape, amplitudes), np.inf)}


EFFECT = TransmissionHysteresis()
