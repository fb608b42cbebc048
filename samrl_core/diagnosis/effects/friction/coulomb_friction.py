"""1: Coulomb friction."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.joint_dynamics import joint_dynamics
from samrl_core.diagnosis.effects.drive_torque import (
    BEYOND,
    DriveEffect,
    DriveForm,
    ShaftForm,
    are_positive,
    are_possible,
    least_bend,
    name_sizes,
    track_joints,
    turn_widths,
    unknown_friction,
    widest_turn,
)
from samrl_core.diagnosis.effects.effect import Parameter, lacks_drive_torque
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, Shape
from samrl_core.diagnosis.residuals.basis_functions import (
    SIGN_SPEEDS,
    bristle,
    half_speed,
    power_sign,
    smooth_sign,
    travel,
)
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_ANGLE = 0.001  # [rad] parked short, from which a joint counts
STIFF = (3e-5, 1e-4)  # [rad] presliding distances below what encoders of arms resolve
WITHIN_A_STEP = 0.4  # of a coarse encoder's step, a further one
TAILS = (0.8, 4.0)  # exponents of a sign that saturates slowly: below, it is no level; above, it is a clip
FIRST_TAIL = 1.3
TAIL_WIDTH = 0.25  # of the widest turn of a tanh: p = 1 nears nine tenths of its level at nine widths


class CoulombFriction(DriveEffect):
    """Dry friction of constant level."""

    family, number, title = "coulomb_friction", 1, "Coulomb friction"
    proper_name = True
    meaning = (
        "A torque of constant size opposes the motion, so the joint needs a push to start and stops off "
        "target."
    )
    remedy = (
        "Add the friction level to the joint's model or compensate it in the controller; if it is far above "
        "the datasheet, check brake, seal and lubrication."
    )
    formula = "tau_f = Fc tanh(dq / v), or Fc dq / (v^p + |dq|^p)^(1/p) where it saturates slowly"
    source = "Olsson et al. 1998, Friction models and friction compensation; ranges: Gaz et al. 2019 (Panda)"
    excitation = "slow sweeps in both directions, reversals"
    curve_over = "velocity"
    renamed_shapes = ("xs",)
    confounded_with = ("viscous_friction", "stribeck_friction", "backlash", "command_delay")
    parameters = (
        Parameter("Fc", "N m", 0.14, 1.5, "friction level"),
        Parameter(
            "parked", "rad", 0.0005, 0.1, "Fc over the servo's stiffness, where no torque was recorded"
        ),
    )
    at_every_joint = True

    def why_unobservable(self, trial: Trial) -> str | None:
        """Also visible as a tracking error."""
        return None if "tracking" in trial.channels else lacks_drive_torque(trial)

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """Width of the transition, or of the bristle, is searched."""
        if "tracking" in trial.channels:
            grid = tuple({"xs": x} for x in (1e-3, 3e-3, 1e-2, 3e-2))
            return (ParkingShort(name="parks short", place=place, amplitudes=("Fc",), shapes=grid),)
        widest = widest_turn(trial, place.joints, 0.1)
        if place.is_arm:
            # One width for joints of unlike speeds is no parameter of any of them: chosen, not searched.
            grid = tuple({"v": v} for v in (*SIGN_SPEEDS, 3 * SIGN_SPEEDS[-1], 10 * SIGN_SPEEDS[-1]))
            common = tuple(shape for shape in grid if shape["v"] <= widest)
            return SmoothSign(name="smooth", place=place, amplitudes=("Fc",), shapes=common).with_shafts(
                trial
            )
        grid = tuple({"v": v} for v in turn_widths(widest))
        limits, bend = {"v": (5e-4, widest)}, least_bend(trial, place.joints)
        stiff = tuple({"xs": x} for x in sorted({*STIFF, max(WITHIN_A_STEP * bend, STIFF[-1])}))
        return (
            SmoothSign(name="smooth", place=place, amplitudes=("Fc",), shapes=grid, refine=limits),
            # Another turn than a tanh's costs more than it seems: tolerated frictions of several widths mend
            # the shape, at the expense of the size.
            SlowSign(
                name="slow to saturate",
                place=place,
                amplitudes=("Fc",),
                shapes=tuple({"v": v, "p": FIRST_TAIL} for v in turn_widths(TAIL_WIDTH * widest)),
                refine={"v": (5e-4, TAIL_WIDTH * widest), "p": TAILS},
            ),
            StiffBristle(
                name="stiff bristle",
                place=place,
                amplitudes=("Fc",),
                shapes=stiff,
                refine={"xs": (1e-5, bend)},
            ),
        )


class SmoothSign(ShaftForm):
    """Smooth sign of the velocity."""

    def friction(self, trial: Trial, speed: np.ndarray, shape: Shape) -> np.ndarray:
        return smooth_sign(speed, shape["v"])

    def spread(self, trial: Trial, joint: int) -> float:
        return 0.1 * trial.scale[joint]

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        stated = joint_dynamics(trial.recording.arm).friction
        return are_possible(self.place, amplitudes, lambda j: BEYOND * unknown_friction(trial, j), stated)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "Fc", amplitudes, self.shaft)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if self.shaft is not None:
            return None  # the simulated drives share no shaft
        return {
            "coulomb": self.at_joints(trial, amplitudes),
            "coulomb_velocity": self.at_joints(trial, shape.get("v", 0.003), 0.005),
        }


class SlowSign(DriveForm):
    """A sign that nears its level by a power of the speed, as arctangents do."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return power_sign(trial.motion.sure_velocity[:, joint], shape["v"], shape["p"])[None]

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.array([0.1 * trial.scale[joint]])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        stated = joint_dynamics(trial.recording.arm).friction
        return bool(amplitudes[0] > -stated[self.joint])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "Fc", amplitudes)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        # The simulator's tanh is a half at the same speed.
        width = half_speed(shape["v"], shape["p"]) / np.arctanh(0.5)
        return {
            "coulomb": self.at_joints(trial, amplitudes),
            "coulomb_velocity": self.at_joints(trial, width, 0.005),
        }


class StiffBristle(DriveForm):
    """A bristle along the position: too stiff to be told from a jump, but it parks where it stopped."""

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return bristle(travel(trial.motion.sure_velocity[:, joint], trial.motion.rate), shape["xs"])[None]

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return np.array([0.1 * trial.scale[joint]])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "Fc", amplitudes)

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {
            "coulomb": self.at_joints(trial, amplitudes),
            "presliding_stiffness": self.at_joints(trial, amplitudes / shape["xs"]),
        }


class ParkingShort(Form):
    """Without torques: a stiff position loop parks short by Fc / K."""

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        command = trial.motion.command
        assert command is not None and command.position is not None
        path = trial.motion.reduce(command.position)
        return track_joints(trial, self.place, lambda j: bristle(path[:, j], shape["xs"])[None])

    def prior(self, trial: Trial, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.place.joints)
        return np.zeros(count), np.full(count, 0.02)

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        return are_positive(self.place, amplitudes, lambda j: LEAST_ANGLE)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return name_sizes(trial, self.place, "parked", amplitudes)


EFFECT = CoulombFriction()
