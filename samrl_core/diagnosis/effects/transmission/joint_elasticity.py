"""11: joint elasticity."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import TorqueDeflection
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

STIFF = (10.0, 25.0, 60.0, 150.0, 350.0)  # [1/rad] grid of stiffness over effort limit
STIFFEST = 400.0  # [1/rad] stiffness over effort limit, 1.7 times what is known of drives: no more is elastic
# Of the largest torque: where a hardening spring is twice as stiff as a straight one.
HARDENS = (0.5, 1.0, 2.0)
DAMPING_S = 0.002  # of stiffness: lightly damped


class JointElasticity(TorqueDeflection):
    """The joint twists under torque, like a spring between motor and link."""

    family, number, title = "joint_elasticity", 11, "Joint elasticity"
    meaning = "The transmission twists under load like a spring, so link and motor angle differ and resonate."
    remedy = "Model the joint with its stiffness, and keep control bandwidth and motions below the resonance."
    formula = "q_link = q_motor - x, tau = K x or K x (1 + (K x / F)^2), with the link swinging on K"
    source = "Spong 1987; hardening: Tuttle and Seering 1996; harmonic drives of this size: 5e3-2e4 N m/rad"
    excitation = "chirp of 1-20 Hz"
    experiment = "chirp"
    confounded_with = ("backlash", "command_delay", "mount_compliance")
    parameters = (
        Parameter("K", "N m/rad", 500.0, 50000.0, "joint stiffness, of a hardening spring at no twist"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        static = Form("static", ("compliance",))
        if "tracking" in trial.channels:
            return (static,)
        (joint,) = self.joints_at(trial, place)
        scale = float(trial.scale[joint])
        grid = tuple({"K": s * scale, "d": DAMPING_S * s * scale} for s in STIFF)
        limits = {"K": (3.0 * scale, 3000.0 * scale), "d": (1e-4 * scale, 5.0 * scale)}
        most = max(float(np.max(np.abs(trial.transmitted[:, joint]))), 1e-3)
        steps = tuple({"F": f * most} for f in HARDENS)
        hardening = Form("hardening", ("compliance",), steps, {"F": (0.1 * most, 5.0 * most)})
        return static, Form("swinging", ("present",), grid, limits), hardening

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        if form != "swinging":
            return super().columns(trial, place, form, shape)
        (joint,) = self.joints_at(trial, place)
        angle = trial.motion.reduce(trial.sprung(joint, shape["K"], shape["d"], 0.0))
        return trial.link(trial.deflection(joint, angle[None]))

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        if form == "hardening":
            return hardened(torque, shape["F"])[None]
        return torque[None] - np.mean(torque) * (1.0 if "tracking" in trial.channels else 0.0)

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        if form == "swinging":
            return np.ones(1), np.full(1, 0.05)
        (joint,) = self.joints_at(trial, place)
        return np.zeros(1), np.full(1, 0.02 / trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        if "tracking" in trial.channels:
            return True
        (joint,) = self.joints_at(trial, place)
        stiffness = self.physical(trial, place, form, shape, amplitudes)["K"]
        return bool(amplitudes[0] > 0 and stiffness < STIFFEST * trial.scale[joint])

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        if form == "swinging":
            return {"K": shape["K"]}
        return {"K": float(1.0 / max(abs(amplitudes[0]), 1e-12))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if "tracking" in trial.channels:
            return None
        joints = self.joints_at(trial, place)
        stiffness = self.physical(trial, place, form, shape, amplitudes)["K"]
        if form == "hardening":  # the simulator's spring is straight
            stiffness = self.line(trial, place, form, shape, amplitudes)
        fields: dict[str, np.ndarray | float] = {
            "joint_stiffness": at_joint(trial, joints, stiffness, np.inf)
        }
        if form == "swinging":
            fields["joint_damping"] = at_joint(trial, joints, shape["d"])
        return fields


def hardened(torque: np.ndarray, level: float) -> np.ndarray:
    """K x (N,) [N m] of a cubic spring under a torque: torque = K x (1 + (K x / level)^2).

    The only real root (Cardano, in hyperbolic form).
    """
    root = np.sqrt(3.0) / 2.0
    return level / root * np.sinh(np.arcsinh(3.0 * root * torque / level) / 3.0)


EFFECT = JointElasticity()
