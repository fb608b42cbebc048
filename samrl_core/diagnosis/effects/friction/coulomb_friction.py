"""1: Coulomb friction."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import BEYOND, ShaftFriction, widest_turn
from samrl_core.diagnosis.residuals.basis_functions import SIGN_SPEEDS, bristle, smooth_sign, travel
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial

LEAST_ANGLE = 0.001  # [rad] parked short, from which a joint counts
STIFF = (3e-5, 1e-4)  # [rad] presliding distances below what encoders of arms resolve


class CoulombFriction(ShaftFriction):
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
    formula = "tau_f = Fc tanh(dq / v)"
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

    def unobservable(self, trial: Trial) -> str | None:
        """Also visible as a tracking error."""
        return None if "tracking" in trial.channels else super().unobservable(trial)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        """Width of the transition, or of the bristle, is searched."""
        if "tracking" in trial.channels:
            return (Form("parks short", ("Fc",), tuple({"xs": x} for x in (1e-3, 3e-3, 1e-2, 3e-2))),)
        widest = widest_turn(trial, self.joints_at(trial, place), 0.1)
        grid = tuple({"v": v} for v in SIGN_SPEEDS if v < widest)
        smooth = Form("smooth", ("Fc",), grid, {"v": (5e-4, widest)})
        if place.startswith("arm:"):
            # One width for joints of unlike speeds is no parameter of any of them: chosen, not searched.
            grid = tuple({"v": v} for v in (*SIGN_SPEEDS, 3 * SIGN_SPEEDS[-1], 10 * SIGN_SPEEDS[-1]))
            common = tuple(shape for shape in grid if shape["v"] <= widest)
            return self.coupled_forms(trial, Form("smooth", ("Fc",), common))
        # A bristle this stiff cannot be told from a jump, but parks where it stopped.
        return smooth, Form("stiff bristle", ("Fc",), tuple({"xs": x} for x in STIFF), {"xs": (1e-5, 1.5e-4)})

    def torque(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """Smooth sign of the velocity, or a stiff bristle along the position."""
        if form == "stiff bristle":
            return bristle(travel(trial.motion.full_velocity[:, joint], trial.motion.rate), shape["xs"])[None]
        return smooth_sign(trial.motion.full_velocity[:, joint], shape["v"])[None]

    def of_shaft(
        self, trial: Trial, first: int, second: int, sign: float, form: str, shape: Shape
    ) -> np.ndarray:
        """Smooth sign of the shaft's speed."""
        speed = trial.motion.full_velocity
        return smooth_sign(speed[:, first] + sign * speed[:, second], shape["v"])[None]

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        """In the drive; without torques, a stiff position loop parks short by Fc / K."""
        if "tracking" in trial.channels:
            joints = self.joints_at(trial, place)
            out: Columns = {}
            for i, j in enumerate(joints):
                rows = np.zeros((len(joints), len(trial)))
                rows[i] = bristle(_command(trial)[:, j], shape["xs"])
                out |= trial.tracking(j, rows)
            return out
        return super().columns(trial, place, form, shape)

    def spread(self, trial: Trial, joint: int, form: str, shape: Shape) -> np.ndarray:
        """A tenth of the effort scale."""
        return np.array([0.02 if "tracking" in trial.channels else 0.1 * trial.scale[joint]])

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        """Friction opposes motion."""
        return self.positive(trial, place, amplitudes)

    def beyond_nominal(self, trial: Trial, joint: int) -> float:
        """Three times the tolerance."""
        if "tracking" in trial.channels:
            return LEAST_ANGLE
        tolerance = np.broadcast_to(trial.recording.arm.tolerances.coulomb_friction, (trial.joints,))[joint]
        return BEYOND * float(tolerance) * trial.scale[joint]

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        """Level."""
        name = "parked" if "tracking" in trial.channels else "Fc"
        return self.sizes(trial, place, form, name, amplitudes)

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        """The same friction in closed loop."""
        if "tracking" in trial.channels:
            return None
        joints = self.joints_at(trial, place)
        if form == "stiff bristle":
            return {
                "coulomb": at_joint(trial, joints, amplitudes),
                "presliding_stiffness": at_joint(trial, joints, amplitudes / shape["xs"]),
            }
        return {
            "coulomb": at_joint(trial, joints, amplitudes),
            "coulomb_velocity": at_joint(trial, joints, shape.get("v", 0.003), 0.005),
        }


def _command(trial: Trial) -> np.ndarray:
    command = trial.motion.command
    assert command is not None and command.position is not None
    return trial.motion.reduce(command.position)


EFFECT = CoulombFriction()
