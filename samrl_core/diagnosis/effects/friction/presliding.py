"""5: presliding."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque
from samrl_core.diagnosis.residuals.basis_functions import bristle, play, travel
from samrl_core.diagnosis.residuals.trial import Trial

SLIP = "Maxwell slip"
YIELDS = (0.25, 0.75, 1.25, 1.75)  # of xs: springs of equal strength that yield at evenly spread twists


class Presliding(DriveTorque):
    """Friction that builds up over a small displacement, like a spring, before it slides."""

    family, number, title = "presliding", 5, "Presliding friction"
    meaning = (
        "Before it slides, the contact bends like a stiff lossy spring, so tiny moves show hysteresis loops."
    )
    remedy = (
        "Use a friction model with a bristle state (LuGre, Dahl) if millirad accuracy or contact matters."
    )
    formula = "dz/dt = dq - |dq| z / xs, tau_f = Fc z / xs, or springs that yield one after another"
    source = (
        "Dahl 1968; Canudas de Wit et al. 1995 (LuGre); generalised Maxwell slip: Iwan 1966, "
        "Al-Bender, Lampaert and Swevers 2005"
    )
    excitation = "reversals of milliradians"
    experiment = "micro_reversals"
    curve_over = "velocity"
    renamed_shapes = ("xs",)
    confounded_with = ("coulomb_friction", "joint_elasticity", "transmission_hysteresis", "backlash")
    parameters = (
        Parameter("Fc", "N m", 0.05, 1.5, "level when sliding"),
        Parameter("sigma0", "N m/rad", 50.0, 10000.0, "stiffness of the contact, Fc / xs"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        limits = {"xs": (1.5e-4, 0.03)}
        return (
            Form("", ("Fc",), tuple({"xs": x} for x in (2e-4, 6e-4, 2e-3, 6e-3)), limits),
            Form(SLIP, ("Fc",), tuple({"xs": x} for x in (1e-3, 6e-3)), limits),
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        motion = trial.motion
        if form != SLIP:
            return bristle(travel(motion.full_velocity[:, joint], motion.rate), shape["xs"])[None]
        q = motion.q[:, joint]
        # The mean of the yields is the distance by which Dahl's bristle turns over, too.
        parts = [(q - play(q, share * shape["xs"])) / (share * shape["xs"]) for share in YIELDS]
        return np.interp(motion.time, motion.t, np.mean(parts, axis=0))[None]

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.array([0.1 * trial.scale[joint]])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"Fc": float(amplitudes[0]), "sigma0": float(amplitudes[0]) / shape["xs"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {
            "coulomb": at_joint(trial, joints, amplitudes[0]),
            "presliding_stiffness": at_joint(trial, joints, amplitudes[0] / shape["xs"]),
        }


EFFECT = Presliding()
