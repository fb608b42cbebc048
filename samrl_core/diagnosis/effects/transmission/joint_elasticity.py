"""11: joint elasticity."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.effects.transmission.deflection import Deflection, TwistForm
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

STIFF = (10.0, 25.0, 60.0, 150.0, 350.0)  # [1/rad] grid of stiffness over effort limit
STIFFEST = 400.0  # [1/rad] stiffness over effort limit, 1.7 times what is known of drives: no more is elastic
# Of the largest torque: where a hardening spring is twice as stiff as a straight one.
HARDENS = (0.5, 1.0, 2.0)
DAMPING_S = 0.002  # of stiffness: lightly damped


class JointElasticity(Deflection):
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

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        static = StraightSpring(name="static", place=place, amplitudes=("compliance",))
        if "tracking" in trial.channels:
            return (static,)
        (joint,) = place.joints
        scale = float(trial.scale[joint])
        grid = tuple({"K": s * scale, "d": DAMPING_S * s * scale} for s in STIFF)
        limits = {"K": (3.0 * scale, 3000.0 * scale), "d": (1e-4 * scale, 5.0 * scale)}
        most = max(float(np.max(np.abs(trial.transmitted[:, joint]))), 1e-3)
        steps = tuple({"F": f * most} for f in HARDENS)
        return (
            static,
            SwingingLink(name="swinging", place=place, amplitudes=("present",), shapes=grid, refine=limits),
            HardeningSpring(
                name="hardening",
                place=place,
                amplitudes=("compliance",),
                shapes=steps,
                refine={"F": (0.1 * most, 5.0 * most)},
            ),
        )


class SpringForm(TwistForm):
    """A spring without mass, whose amplitude is its compliance."""

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), np.full(1, 0.02 / trial.scale[self.joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        if "tracking" in trial.channels:
            return True
        stiffness = self.parameters(trial, shape, amplitudes)["K"]
        return bool(amplitudes[0] > 0 and stiffness < STIFFEST * trial.scale[self.joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"K": float(1.0 / max(abs(amplitudes[0]), 1e-12))}


class StraightSpring(SpringForm):
    """Twist in proportion to the torque."""

    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        return torque[None] - np.mean(torque) * (1.0 if "tracking" in trial.channels else 0.0)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if "tracking" in trial.channels:
            return None
        stiffness = self.parameters(trial, shape, amplitudes)["K"]
        return {"joint_stiffness": self.at_joints(trial, stiffness, np.inf)}


class HardeningSpring(SpringForm):
    """A cubic spring."""

    def angle(self, trial: Trial, torque: np.ndarray, shape: Shape) -> np.ndarray:
        return hardened(torque, shape["F"])[None]

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # The simulator's spring is straight.
        return {"joint_stiffness": self.at_joints(trial, self.line(trial, shape, amplitudes), np.inf)}


class SwingingLink(Form):
    """The link swings on its spring."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        angle = trial.motion.reduce(trial.sprung(self.joint, shape["K"], shape["d"], 0.0))
        return trial.link(trial.deflection(self.joint, angle[None]))

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.ones(1), np.full(1, 0.05)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0 and shape["K"] < STIFFEST * trial.scale[self.joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"K": shape["K"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {
            "joint_stiffness": self.at_joints(trial, shape["K"], np.inf),
            "joint_damping": self.at_joints(trial, shape["d"]),
        }


def hardened(torque: np.ndarray, level: float) -> np.ndarray:
    """K x (N,) [N m] of a cubic spring under a torque: torque = K x (1 + (K x / level)^2).

    The only real root (Cardano, in hyperbolic form).
    """
    root = np.sqrt(3.0) / 2.0
    return level / root * np.sinh(np.arcsinh(3.0 * root * torque / level) / 3.0)


EFFECT = JointElasticity()
