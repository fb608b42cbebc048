"""7: position-dependent friction."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import (
    TRAVEL_UNITS,
    DriveEffect,
    DriveForm,
    least_ripple_order,
    travel_unit,
    usual_turns,
    widest_turn,
)
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import smooth_sign
from samrl_core.diagnosis.residuals.trial import Trial

ORDERS = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
WAVES = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)  # the same in steps that the travel tells apart
OVER_TRAVEL = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0)  # periods within a short travel, whose orders are beyond these
WHOLE_WAVE = 0.9 * 2.0 * np.pi / TRAVEL_UNITS  # nearly a period over the travel of a slide
LOWEST, HIGHEST = 0.9, 15.0  # once per turn at least: less is a spring
LEAST_NEGATIVE = 0.25  # of the largest friction: what missing harmonics may make negative somewhere
LEAST_WAVE = 0.25  # of a harmonic's root mean square that must vary over the travel
LEAST_CHANGE = 0.1  # likewise of a friction with a level, which for the rest is Coulomb's


class PositionDependentFriction(DriveEffect):
    """Torque or friction that repeats with the joint's position: tight spots, eccentric bearings."""

    family, number, title = "position_dependent_friction", 7, "Position-dependent friction"
    meaning = "Friction changes with joint angle and repeats there, as with a bent shaft or an uneven gear."
    remedy = "Add a friction table over the angle; inspect the bearing at the angles where the curve peaks."
    formula = "tau_f = a sin(k q + phi) (tanh(dq / v) or 1), or (level + a sin(k q + phi) + 2k) tanh(dq / v)"
    source = (
        "harmonics shrink the gap of a real Panda by 0.15-0.2; friction over a turn as a Fourier series of "
        "low orders: Popovic and Goldenberg 1998; Garcia et al. 2002"
    )
    excitation = "slow sweep over the whole range, both ways"
    experiment = "sweep"
    curve_over = "position"
    renamed_shapes = ("k",)
    confounded_with = ("cable", "gear_ripple", "payload")
    parameters = (
        Parameter("amplitude", "N m", 0.05, 0.5, "of the harmonic"),
        Parameter("order", "1/rad", 1.0, 12.0, "periods per 2 pi"),
        Parameter("phase", "rad", -3.1416, 3.1416, "of the sine", bounded=False),
        Parameter("level", "N m", 0.0, 1.5, "mean over the turn, of a friction that is one everywhere"),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        (joint,) = place.joints
        unit = travel_unit(trial, joint)
        periods = [2.0 * np.pi * n / max(float(trial.travel[joint]), 1e-6) for n in OVER_TRAVEL]
        ripple = least_ripple_order(trial, joint)
        few = [k for k in periods if k > max(ORDERS) / unit]
        grid = tuple({"k": k} for k in (*(k / unit for k in ORDERS), *few))
        limits, wave = (
            {"k": (LOWEST / unit, max([HIGHEST / unit, *(1.3 * k for k in few)]))},
            ("sine", "cosine"),
        )
        turns = usual_turns(trial, place.joints)
        turning = {**limits, "v": (5e-4, widest_turn(trial, place.joints, 0.1))}
        # A slide runs from end to end, its speed by its place: less than a period of a free shape is a drag.
        assert trial.rigid is not None
        lowest = WHOLE_WAVE if trial.rigid.slides[joint] else LOWEST
        # Half a period over the travel is what one order stands out from the next by: no wider gap is left.
        everywhere = (
            *(k / unit for k in WAVES if k > lowest),
            *(k for k in periods if k > 1.1 * max(WAVES) / unit),
        )
        return (
            FrictionWave(
                name="friction",
                place=place,
                amplitudes=wave,
                shapes=tuple({**shape, "v": v} for shape in grid for v in turns),
                refine=turning,
            ),
            # Beyond these orders a torque is called gear ripple.
            TorqueWave(
                name="torque",
                place=place,
                amplitudes=wave,
                shapes=tuple(shape for shape in grid[: len(ORDERS)] if shape["k"] < ripple),
                refine={"k": (LOWEST / unit, ripple)},
            ),
            FrictionEverywhere(
                name="friction everywhere",
                place=place,
                amplitudes=("level", "sine", "cosine", "sine2", "cosine2"),
                shapes=tuple({"k": k, "v": v} for k in everywhere for v in turns),
                refine={**turning, "k": (lowest / unit, turning["k"][1])},
            ),
        )


class WaveForm(DriveForm):
    """Waves over the joint's angle."""

    @abstractmethod
    def waves(self, angle: np.ndarray) -> np.ndarray:
        """Waves (p, ...) over an angle, one for each amplitude."""

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(len(self.amplitudes), 0.05 * trial.scale[joint])

    def varies(self, trial: Trial, shape: Shape, amplitudes: np.ndarray, least: float) -> bool:
        """Whether the wave varies over the travel by a share of its root mean square.

        Over a short travel a long wave is constant: Coulomb friction under another name.
        """
        angle = shape["k"] * trial.motion.q[:: max(1, len(trial) // 200), self.joint]
        wave = np.asarray(amplitudes @ self.waves(angle))
        return bool(np.std(wave) > least * np.sqrt(np.mean(wave**2)))

    def name_wave(self, shape: Shape, a: float, b: float) -> dict[str, float]:
        """Parameters of a wave of sine a and cosine b."""
        return {"amplitude": float(np.hypot(a, b)), "order": shape["k"], "phase": float(np.arctan2(b, a))}

    def simulate_wave(
        self, trial: Trial, head: str, shape: Shape, level: float, a: float, b: float
    ) -> PlantFields:
        """Fields of a simulator that knows one harmonic, upon a level."""
        return {
            "coulomb": self.at_joints(trial, level),
            "coulomb_velocity": self.at_joints(trial, shape.get("v", 0.005), 0.005),
            f"{head}_amplitude": self.at_joints(trial, np.hypot(a, b)),
            f"{head}_order": self.at_joints(trial, shape["k"]),
            f"{head}_phase": self.at_joints(trial, np.arctan2(b, a)),
        }


class FrictionWave(WaveForm):
    """A harmonic of the friction."""

    def waves(self, angle: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(angle), np.cos(angle)])

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        rows = self.waves(shape["k"] * trial.motion.full_position[:, joint])
        return rows * smooth_sign(trial.motion.sure_velocity[:, joint], shape["v"])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return self.varies(trial, shape, amplitudes, LEAST_WAVE)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return self.name_wave(shape, *amplitudes)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return self.simulate_wave(trial, "friction_harmonic", shape, 0.0, *amplitudes)


class TorqueWave(WaveForm):
    """A harmonic of the torque, whichever way the joint turns."""

    def waves(self, angle: np.ndarray) -> np.ndarray:
        return np.stack([np.sin(angle), np.cos(angle)])

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return self.waves(shape["k"] * trial.motion.full_position[:, joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return self.varies(trial, shape, amplitudes, LEAST_WAVE)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return self.name_wave(shape, *amplitudes)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # A torque is lost as the residual counts it, and added by the simulator.
        a, b = -amplitudes
        return self.simulate_wave(trial, "harmonic", shape, 0.0, a, b)


class FrictionEverywhere(WaveForm):
    """A friction that is positive all over the turn: a level with two harmonics."""

    def waves(self, angle: np.ndarray) -> np.ndarray:
        rows = [np.ones_like(angle), np.sin(angle), np.cos(angle), np.sin(2 * angle), np.cos(2 * angle)]
        return np.stack(rows)

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        rows = self.waves(shape["k"] * trial.motion.full_position[:, joint])
        return rows * smooth_sign(trial.motion.sure_velocity[:, joint], shape["v"])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Also where the joint has not been: else a short travel is fitted by huge waves that cancel.
        turn = np.asarray(amplitudes @ self.waves(np.linspace(0.0, 2.0 * np.pi, 60)))
        if np.min(turn) < -LEAST_NEGATIVE * np.max(turn):
            return False
        return self.varies(trial, shape, amplitudes, LEAST_CHANGE)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {**self.name_wave(shape, *amplitudes[1:3]), "level": float(amplitudes[0])}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return self.simulate_wave(trial, "friction_harmonic", shape, *amplitudes[:3])


EFFECT = PositionDependentFriction()
