"""6: friction asymmetry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.diagnosis.effects.drive_torque import (
    BEYOND,
    DriveEffect,
    DriveForm,
    fastest_motion,
    turn_widths,
    unknown_friction,
    unknown_torque,
    widest_turn,
)
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_OFFSET = 0.1  # difference over mean of what differs by direction


class FrictionAsymmetry(DriveEffect):
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
    confounded_with = ("torque_offset", "torque_sensor_error", "coulomb_friction")
    contains = ("coulomb_friction",)
    parameters = (
        Parameter("mean", "N m", 0.0, 1.5, "(Fp + Fn) / 2"),
        Parameter("difference", "N m", 0.05, 1.0, "(Fp - Fn) / 2"),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        widest, wide = (widest_turn(trial, place.joints, most) for most in (0.05, 0.2))
        grid = tuple({"v": v} for v in turn_widths(widest))
        faster = max(1.0, fastest_motion(trial, place.joints))  # than arms: offsets grow with the speeds
        limits = {"v": (2e-3, wide), "b": (2e-3, 0.15 * faster)}
        offsets = tuple({"v": min(v * faster, 0.9 * wide), "b": 0.03 * faster} for v in (0.01, 0.05))
        return (
            Levels(
                name="levels",
                place=place,
                amplitudes=("mean", "difference"),
                shapes=grid,
                refine={"v": (5e-4, widest)},
            ),
            *(
                Offset(name=name, place=place, amplitudes=("mean",), shapes=offsets, refine=limits, side=side)
                for name, side in (("offset ahead", 1.0), ("offset behind", -1.0))
            ),
        )


class Levels(DriveForm):
    """A level for each direction."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return _level_rows(trial, joint, shape["v"])

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(2, 0.05 * trial.scale[joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Without a link-side sensor, a drive offset looks the same: only a strong one is an asymmetry.
        least = 0.4 if "dynamics" in trial.channels else 0.1
        level, difference = amplitudes[0], abs(amplitudes[1])
        return bool(
            difference > least * abs(level) and level > difference - _most_friction(trial, self.joint)
        )

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"mean": float(amplitudes[0]), "difference": float(amplitudes[1])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        level, difference = amplitudes
        return {
            "coulomb": self.at_joints(trial, level),
            "friction_asymmetry": self.at_joints(trial, difference),
            "coulomb_velocity": self.at_joints(trial, shape["v"], 0.005),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class Offset(DriveForm):
    """A sigmoid that turns at another speed than zero."""

    side: float  # sign of that speed

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        offset = self.side * shape["b"]
        speed = trial.motion.sure_velocity[:, joint]
        return (smooth_sign(speed + offset, shape["v"]) - np.tanh(offset / shape["v"]))[None]

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(1, 0.05 * trial.scale[joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        # A sigmoid that turns at zero is Coulomb's.
        return bool(amplitudes[0] > 0 and np.tanh(shape["b"] / shape["v"]) > LEAST_OFFSET)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {
            "mean": float(amplitudes[0]),
            "difference": float(-self.side * amplitudes[0] * np.tanh(shape["b"] / shape["v"])),
        }

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        """Levels and width by which the simulator, which knows no offset, comes closest at these speeds."""
        joint = self.joint
        wanted = float(amplitudes[0]) * self.torque(trial, joint, shape)[0]
        best = np.inf, 0.0, 0.0, shape["v"]
        for width in shape["v"] * np.array([0.5, 0.7, 1.0, 1.4, 2.0]):
            rows = _level_rows(trial, joint, float(width))
            (level, difference), *_ = np.linalg.lstsq(rows.T, wanted, rcond=None)
            error = float(np.mean((level * rows[0] + difference * rows[1] - wanted) ** 2))
            if error < best[0]:
                best = error, float(level), float(difference), float(width)
        _, level, difference, width = best
        return {
            "coulomb": self.at_joints(trial, level),
            "friction_asymmetry": self.at_joints(trial, difference),
            "coulomb_velocity": self.at_joints(trial, width, 0.005),
        }


def _most_friction(trial: Trial, joint: int) -> float:
    """Dry friction [N m] that the model may have: beyond it the lesser level would drive the joint."""
    stated = float(joint_dynamics(trial.recording.arm).friction[joint])
    return stated + BEYOND * (unknown_friction(trial, joint) + unknown_torque(trial, joint))


def _level_rows(trial: Trial, joint: int, width: float) -> np.ndarray:
    """Lost torque (2, F) per unit of mean and of difference."""
    sign = smooth_sign(trial.motion.sure_velocity[:, joint], width)
    return np.stack([sign, sign**2])


EFFECT = FrictionAsymmetry()
