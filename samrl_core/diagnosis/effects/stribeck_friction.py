"""3: Stribeck friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, fastest_motion, single, widest_turn
from samrl_core.diagnosis.effects.shapes import smooth_sign
from samrl_core.diagnosis.trial import Trial


class StribeckFriction(DriveTorque):
    """Dry friction that drops as the film builds up: stick-slip at crawling speed."""

    family, number, title = "stribeck_friction", 3, "Stribeck friction"
    formula = "tau_f = (Fc + (Fs - Fc) exp(-(dq / vs)^2)) tanh(dq / v)"
    source = "Armstrong-Helouvry et al. 1994; a Panda joint 7 drops from 0.52 to 0.30 N m by 0.15 rad/s"
    excitation = "crawl at 0.01-0.2 rad/s"
    confounded_with = ("coulomb_friction", "presliding")
    parameters = (
        Parameter("Fc", "N m", 0.0, 1.5, "level at speed"),
        Parameter("drop", "N m", 0.05, 0.6, "Fs - Fc, rise towards rest"),
        Parameter("vs", "rad/s", 0.02, 0.3, "Stribeck velocity"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        # A drop that is not over at the fastest motion cannot be told from the level.
        fastest = fastest_motion(trial, self.joints_at(trial, place))
        speeds = [vs for vs in (0.03, 0.08, 0.2) if vs < fastest] or [0.03]
        grid = tuple({"v": v, "vs": vs} for v in (0.003, 0.01) for vs in speeds)
        widest = min(0.03, widest_turn(trial, self.joints_at(trial, place), 0.1))
        return single(
            ("Fc", "drop"), grid, v=(5e-4, max(widest, 0.011)), vs=(0.01, max(min(0.6, fastest), 0.04))
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        speed = trial.motion.full_velocity[:, joint]
        sign = smooth_sign(speed, shape["v"])
        return np.stack([sign, sign * np.exp(-((speed / shape["vs"]) ** 2))])

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.full(2, 0.1 * trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[1] > 0 and amplitudes[0] > -0.1 * amplitudes[1])

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"Fc": float(amplitudes[0]), "drop": float(amplitudes[1]), "vs": shape["vs"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {
            "coulomb": at_joint(trial, joints, amplitudes[0]),
            "coulomb_velocity": at_joint(trial, joints, shape["v"], 0.005),
            "stribeck_drop": at_joint(trial, joints, amplitudes[1]),
            "stribeck_velocity": at_joint(trial, joints, shape["vs"], 0.1),
        }
