"""6: friction asymmetry."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque, widest_turn
from samrl_core.diagnosis.residuals.basis_functions import SIGN_SPEEDS, smooth_sign
from samrl_core.diagnosis.residuals.trial import Trial

OFFSETS = {"offset ahead": 1.0, "offset behind": -1.0}  # of the speed at which a sigmoid turns


class FrictionAsymmetry(DriveTorque):
    """Dry friction with another level in each direction."""

    family, number, title = "friction_asymmetry", 6, "Direction-dependent friction"
    meaning = "Friction differs between the two directions of motion."
    remedy = (
        "Give the model one level per direction; a large difference hints at a preloaded or damaged gear."
    )
    formula = "tau_f = Fp for dq > 0, -Fn for dq < 0, or mean (tanh((dq + b) / v) - tanh(b / v))"
    source = "Gaz et al. 2019: velocity offsets -0.046 to 0.040 rad/s of the Panda's sigmoid friction"
    excitation = "the same poses in both directions"
    curve_over = "velocity"
    confounded_with = ("torque_sensor_error", "coulomb_friction")
    parameters = (
        Parameter("mean", "N m", 0.0, 1.5, "(Fp + Fn) / 2"),
        Parameter("difference", "N m", 0.05, 1.0, "(Fp - Fn) / 2"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        joints = self.joints_at(trial, place)
        widest, wide = widest_turn(trial, joints, 0.05), widest_turn(trial, joints, 0.2)
        grid = tuple({"v": v} for v in SIGN_SPEEDS if v < widest)
        return (
            Form("levels", ("mean", "difference"), grid, {"v": (5e-4, widest)}),
            *(
                Form(
                    name,
                    ("mean",),
                    tuple({"v": min(v, 0.9 * wide), "b": 0.03} for v in (0.01, 0.05)),
                    {"v": (2e-3, wide), "b": (2e-3, 0.15)},
                )
                for name in OFFSETS
            ),
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        speed = trial.motion.full_velocity[:, joint]
        if form in OFFSETS:
            offset = OFFSETS[form] * shape["b"]
            return (smooth_sign(speed + offset, shape["v"]) - np.tanh(offset / shape["v"]))[None]
        sign = smooth_sign(speed, shape["v"])
        return np.stack([sign, sign**2])

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.full(1 if form in OFFSETS else 2, 0.05 * trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        if form in OFFSETS:
            return bool(amplitudes[0] > 0)
        # Without a link-side sensor, a drive offset looks the same: only a strong one is an asymmetry.
        least = 0.4 if "dynamics" in trial.channels else 0.1
        return bool(abs(amplitudes[1]) > least * abs(amplitudes[0]) and amplitudes[0] > -abs(amplitudes[1]))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        if form in OFFSETS:
            return {
                "mean": float(amplitudes[0]),
                "difference": float(-OFFSETS[form] * amplitudes[0] * np.tanh(shape["b"] / shape["v"])),
            }
        return {"mean": float(amplitudes[0]), "difference": float(amplitudes[1])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        if form in OFFSETS:
            level, difference, width = self._as_levels(trial, joints[0], form, shape, float(amplitudes[0]))
        else:
            (level, difference), width = amplitudes, shape["v"]
        return {
            "coulomb": at_joint(trial, joints, level),
            "friction_asymmetry": at_joint(trial, joints, difference),
            "coulomb_velocity": at_joint(trial, joints, width, 0.005),
        }

    def _as_levels(
        self, trial: Trial, joint: int, form: str, shape: Shape, size: float
    ) -> tuple[float, float, float]:
        """Levels and width by which the simulator, which knows no offset, comes closest at these speeds."""
        wanted = size * self.torque(trial, joint, form, shape)[0]
        best = np.inf, 0.0, 0.0, shape["v"]
        for width in shape["v"] * np.array([0.5, 0.7, 1.0, 1.4, 2.0]):
            rows = self.torque(trial, joint, "levels", {"v": float(width)})
            (level, difference), *_ = np.linalg.lstsq(rows.T, wanted, rcond=None)
            error = float(np.mean((level * rows[0] + difference * rows[1] - wanted) ** 2))
            if error < best[0]:
                best = error, float(level), float(difference), float(width)
        return best[1:]


EFFECT = FrictionAsymmetry()
