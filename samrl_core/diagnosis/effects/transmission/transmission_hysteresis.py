"""12: transmission hysteresis."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import TorqueDeflection
from samrl_core.diagnosis.effects.transmission.joint_elasticity import STIFFEST
from samrl_core.diagnosis.residuals.basis_functions import bristle, rubbing_spring
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_LOOP = 1e-4  # [rad] less is below what is known of drives
LEAST_TURN = 0.2  # of the spring's stiffness, that a turn must add: less is a plain spring


class TransmissionHysteresis(TorqueDeflection):
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
    by_turns = ("spring",)
    prior_cost = 10.0  # it holds a plain spring as a special case: its loop must earn two more shapes

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        """A loop of the angle alone, and a spring with friction beside it."""
        (joint,) = self.joints_at(trial, place)
        seen = trial.motion.u if trial.motion.u is not None else trial.motion.q
        span = max(float(np.ptp(seen[:, joint])), 1e-3)
        loop = Form("", ("a",), tuple({"ts": f * span} for f in (0.05, 0.2)), {"ts": (0.01 * span, span)})
        grid = tuple({"ts": t * span, "y": y * span} for t in (0.1, 0.3) for y in (0.04, 0.12, 0.35))
        # a slider that does not turn round within the torques that were seen is a part of the spring
        limits = {"ts": (0.01 * span, 0.5 * span), "y": (0.005 * span, 0.5 * span)}
        return loop, Form("spring", ("compliance",), grid, limits)

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        if form == "":
            return bristle(torque, shape["ts"])[None]
        twist = rubbing_spring(torque, shape["ts"], shape["y"])
        return (twist - np.mean(twist) * (1.0 if "tracking" in trial.channels else 0.0))[None]

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        (joint,) = self.joints_at(trial, place)
        return np.zeros(1), np.full(1, 0.005 if form == "" else 0.02 / trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        found = self.physical(trial, place, form, shape, amplitudes)
        if not found["a"] > LEAST_LOOP:
            return False
        (joint,) = self.joints_at(trial, place)
        return form == "" or bool(
            found["ts"] > LEAST_TURN * shape["y"] and found["K"] < STIFFEST * trial.scale[joint]
        )

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        if form == "":
            return {"a": float(amplitudes[0]), "ts": shape["ts"]}
        compliance = float(amplitudes[0])
        return {
            "a": compliance * shape["ts"],
            "ts": shape["ts"],
            "K": 1.0 / max(abs(compliance), 1e-12),
        }

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if "tracking" in trial.channels:
            return None
        joints = self.joints_at(trial, place)
        if form == "spring":  # the simulator's spring does not rub
            stiffness = self.line(trial, place, form, shape, amplitudes)
            return {"joint_stiffness": at_joint(trial, joints, stiffness, np.inf)}
        return {
            "hysteresis_amplitude": at_joint(trial, joints, amplitudes[0]),
            "hysteresis_torque": at_joint(trial, joints, shape["ts"], 1.0),
        }


EFFECT = TransmissionHysteresis()
