"""7: position-dependent friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import DriveTorque
from samrl_core.diagnosis.effects.shapes import smooth_sign
from samrl_core.diagnosis.trial import Trial

LEAST_WAVE = 0.25  # of a harmonic's root mean square that must vary over the travel


class PositionDependentFriction(DriveTorque):
    """Torque that repeats with the joint's position: tight spots, eccentric bearings."""

    family, number, title = "position_dependent_friction", 7, "position-dependent friction"
    formula = "tau_f = a sin(k q + phi) (tanh(dq / v) or 1)"
    source = "harmonics shrink the gap of a real Panda by 0.15-0.2"
    excitation = "slow sweep over the whole range, both ways"
    confounded_with = ("cable", "gear_ripple", "payload")
    parameters = (
        Parameter("amplitude", "N m", 0.05, 0.5, "of the harmonic"),
        Parameter("order", "1/rad", 1.0, 12.0, "periods per 2 pi"),
        Parameter("phase", "rad", -3.1416, 3.1416, "of the sine"),
    )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        grid = tuple({"k": float(k)} for k in (1, 2, 3, 4, 6, 8, 12))
        limits = {"k": (0.7, 15.0)}
        return (
            Form("friction", ("sine", "cosine"), grid, limits),
            Form("torque", ("sine", "cosine"), grid, limits),
        )

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        angle = shape["k"] * trial.motion.full_position[:, joint]
        rows = np.stack([np.sin(angle), np.cos(angle)])
        if form == "friction":
            rows = rows * smooth_sign(trial.motion.full_velocity[:, joint], 0.005)
        return rows

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        return np.full(2, 0.05 * trial.scale[joint])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Over a short travel a long wave is constant: Coulomb friction under another name.
        (joint,) = self.joints_at(trial, place)
        angle = shape["k"] * trial.motion.q[:: max(1, len(trial) // 200), joint]
        wave = amplitudes[0] * np.sin(angle) + amplitudes[1] * np.cos(angle)
        return bool(np.std(wave) > LEAST_WAVE * np.sqrt(np.mean(wave**2)))

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        a, b = amplitudes
        return {"amplitude": float(np.hypot(a, b)), "order": shape["k"], "phase": float(np.arctan2(b, a))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        head = "friction_harmonic" if form == "friction" else "harmonic"
        # A friction is lost as the residual counts it; a torque is added by the simulator.
        a, b = amplitudes if form == "friction" else -amplitudes
        return {
            f"{head}_amplitude": at_joint(trial, joints, np.hypot(a, b)),
            f"{head}_order": at_joint(trial, joints, shape["k"]),
            f"{head}_phase": at_joint(trial, joints, np.arctan2(b, a)),
        }
