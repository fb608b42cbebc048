"""9: thermal friction drift."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, DriveForm, usual_turns, widest_turn
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import low_passed, smooth_sign
from samrl_core.diagnosis.residuals.motion import RecordedMotion
from samrl_core.diagnosis.residuals.trial import Trial


class ThermalFriction(DriveEffect):
    """Dry friction that changes as the joint warms up, with time or by its own motion."""

    family, number, title = "thermal_friction", 9, "Friction that drifts with temperature"
    meaning = "Friction falls or rises while the drive warms up."
    remedy = (
        "Warm the arm up before recording or learning, or let the model's friction follow time or "
        "temperature."
    )
    formula = (
        "tau_f = (Finf + (F0 - Finf) exp(-x)) tanh(dq / v), x = t / T, T dx/dt = |dq| / vw - x"
        " or dx/dt = |dq| / path"
    )
    source = (
        "Bittencourt et al. 2010: friction of a robot joint over load and temperature; heat from the "
        "friction's own work: Simoni et al. 2015, friction modeling with temperature effects for robots"
    )
    excitation = "the same move, cold and warm"
    curve_over = "velocity"
    confounded_with = ("coulomb_friction", "payload")
    contains = ("coulomb_friction",)
    parameters = (
        Parameter("Finf", "N m", 0.0, 1.5, "level when warm"),
        Parameter("F0", "N m", 0.1, 2.0, "level when cold"),
        Parameter("T", "s", 2.0, 3600.0, "time constant"),
        Parameter("vw", "rad/s", 0.01, 1.0, "mean speed that warms the joint by one e-folding"),
        Parameter(
            "path", "rad", 0.5, 50.0, "path that warms the joint by one e-folding, where nothing cools"
        ),
    )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        turns = usual_turns(trial, place.joints)
        grid = tuple({"T": t, "v": v} for t in (3.0, 10.0, 40.0, 300.0) for v in turns)
        turn = (5e-4, widest_turn(trial, place.joints, 0.1))
        limits, names = {"T": (0.3, 3600.0), "v": turn}, ("Finf", "rise")
        return (
            WarmingWithTime(
                name="each recording", place=place, amplitudes=names, shapes=grid, refine=limits, once=False
            ),
            WarmingWithTime(
                name="session",
                place=place,
                amplitudes=names,
                shapes=grid[2 * len(turns) :],
                refine=limits,
                once=True,
            ),
            WarmingByWork(
                name="by its work",
                place=place,
                amplitudes=names,
                shapes=tuple(
                    {"T": t, "vw": vw, "v": v} for t in (3.0, 10.0) for vw in (0.05, 0.2) for v in turns
                ),
                refine={"T": (0.3, 600.0), "vw": (0.01, 2.0), "v": turn},
            ),
            WarmingByPath(
                name="by its path",
                place=place,
                amplitudes=names,
                shapes=tuple({"path": path, "v": turns[0]} for path in (0.5, 2.0, 8.0)),
                refine={"path": (0.1, 100.0), "v": turn},
            ),
        )


class WarmingForm(DriveForm):
    """A warm level, and a rise above it that is lost as the drive warms up."""

    may_vanish = (0,)

    @abstractmethod
    def cold(self, motion: RecordedMotion, joint: int, shape: Shape) -> np.ndarray:
        """Share (F,) of the rise that is left."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        sign = smooth_sign(trial.motion.sure_velocity[:, joint], shape["v"])
        return np.stack([sign, sign * self.cold(trial.motion, joint, shape)])

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.full(2, 0.1 * trial.scale[joint])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        warm, rise = amplitudes
        # Warm grease is thinner: friction that grows as the drive warms is something else, switched on late.
        return bool(rise > 0 and warm > -0.1 * rise and rise > 0.2 * abs(warm))

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        found = {"Finf": float(amplitudes[0]), "F0": float(amplitudes[0] + amplitudes[1]), "T": shape["T"]}
        return {**found, "vw": shape["vw"]} if "vw" in shape else found

    def simulate_warming(
        self, trial: Trial, shape: Shape, warm: float, rise: float, time: float
    ) -> PlantFields:
        """Fields of a simulator that warms with time."""
        warm = max(warm, 1e-6)
        return {
            "coulomb": self.at_joints(trial, warm),
            "coulomb_velocity": self.at_joints(trial, shape["v"], 0.005),
            "thermal_ratio": self.at_joints(trial, rise / warm),
            "thermal_time": self.at_joints(trial, time, 60.0),
        }

    def simulate_nearest(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields:
        """Fields of a simulator that warms with time alone, as near as it comes in this recording."""
        motion = trial.motion
        level = float(amplitudes[0]) + float(amplitudes[1]) * self.cold(motion, self.joint, shape)
        return self.simulate_warming(trial, shape, *_fit_time(motion.elapsed, level))


@dataclass(frozen=True, eq=False, kw_only=True)
class WarmingWithTime(WarmingForm):
    """Cold at the start of each recording, or once before the first."""

    once: bool

    def cold(self, motion: RecordedMotion, joint: int, shape: Shape) -> np.ndarray:
        return np.exp(-(self.ran(motion) + motion.elapsed) / shape["T"])

    def ran(self, motion: RecordedMotion) -> float:
        """How long the drive had run when the recording began [s]."""
        return motion.start_s if self.once else 0.0

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        warm, rise = map(float, amplitudes)
        ran = self.at_joints(trial, self.ran(trial.motion))
        return {**self.simulate_warming(trial, shape, warm, rise, shape["T"]), "thermal_offset": ran}


class WarmingByWork(WarmingForm):
    """Warmed by the joint's own motion."""

    def cold(self, motion: RecordedMotion, joint: int, shape: Shape) -> np.ndarray:
        return np.exp(-_warmth(motion, joint, shape["T"]) / shape["vw"])

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return self.simulate_nearest(trial, shape, amplitudes)


class WarmingByPath(WarmingForm):
    """The same where nothing cools meanwhile: the path of the motion alone counts."""

    def cold(self, motion: RecordedMotion, joint: int, shape: Shape) -> np.ndarray:
        return np.exp(-np.cumsum(np.abs(motion.sure_velocity[:, joint])) / motion.rate / shape["path"])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        warm, rise = map(float, amplitudes)
        return {"Finf": warm, "F0": warm + rise, "path": shape["path"]}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return self.simulate_nearest(trial, shape, amplitudes)


def _warmth(motion: RecordedMotion, joint: int, time_constant: float) -> np.ndarray:
    """Speed (F,) [rad/s] as a temperature of first order feels it, cold when the recording starts.

    The friction's own work per time is its torque times the speed; its torque changes less than the speed.
    """
    speed = np.abs(motion.sure_velocity[:, joint])
    # The filter starts settled on its first sample: a zero ahead of the recording makes that cold.
    return low_passed(np.append(0.0, speed), 1.0 / (2.0 * np.pi * time_constant), motion.rate)[1:]


def _fit_time(time: np.ndarray, level: np.ndarray) -> tuple[float, float, float]:
    """Warm level, rise and time constant of the simulator, which warms with time alone, that come closest."""
    best: tuple[float, float, float, float] = (np.inf, 0.0, 0.0, 1.0)
    for constant in np.geomspace(0.3, 60.0, 16):
        terms = np.stack([np.ones_like(time), np.exp(-time / constant)], axis=1)
        (warm, rise), *_ = np.linalg.lstsq(terms, level, rcond=None)
        error = float(np.mean((terms @ [warm, rise] - level) ** 2))
        if error < best[0] and warm > 0:
            best = error, float(warm), float(rise), float(constant)
    return best[1:]


EFFECT = ThermalFriction()
