"""9: thermal friction drift."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque
from samrl_core.diagnosis.effects.shapes import smooth_sign
from samrl_core.diagnosis.trial import Trial


class ThermalFriction(DriveTorque):
    """Dry friction that changes as the joint warms up."""

    family, number, title = "thermal_friction", 9, "thermal friction drift"
    formula = "tau_f = (Finf + (F0 - Finf) exp(-t / T)) tanh(dq / v)"
    source = "Bittencourt et al. 2010: friction of a robot joint over load and temperature"
    excitation = "the same move, cold and warm"
    confounded_with = ("coulomb_friction", "payload")
    parameters = (
        Parameter("Finf", "N m", 0.0, 1.5, "level when warm"),
        Parameter("F0", "N m", 0.1, 2.0, "level when cold"),
        Parameter("T", "s", 2.0, 3600.0, "time constant"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        grid = tuple({"T": t} for t in (3.0, 10.0, 40.0, 300.0))
        limits = {"T": (0.3, 3600.0)}
        # Cold at the start of each recording, or once before the first.
        return (
            Form("each recording", ("Finf", "rise"), grid, limits),
            Form("session", ("Finf", "rise"), grid[2:], limits),
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        sign = smooth_sign(trial.motion.full_velocity[:, joint], 0.005)
        start = trial.motion.start_s if form == "session" else 0.0
        time = start + trial.motion.time - trial.motion.time[0]
        return np.stack([sign, sign * np.exp(-time / shape["T"])])

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.full(2, 0.1 * trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        warm, rise = amplitudes
        return bool(warm + rise > 0 and warm > -0.1 * abs(rise) and abs(rise) > 0.2 * abs(warm))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"Finf": float(amplitudes[0]), "F0": float(amplitudes[0] + amplitudes[1]), "T": shape["T"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        warm = max(float(amplitudes[0]), 1e-6)
        return {
            "coulomb": at_joint(trial, joints, warm),
            "thermal_ratio": at_joint(trial, joints, amplitudes[1] / warm),
            "thermal_time": at_joint(trial, joints, shape["T"], 60.0),
        }
