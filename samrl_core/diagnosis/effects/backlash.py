"""10: backlash."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import Deflection
from samrl_core.diagnosis.effects.shapes import play
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial

GAPS = (2e-4, 8e-4, 3e-3)  # [rad]
FLANK = 300.0  # [1/rad] stiffness of a tooth over effort limit, before it is searched
DAMPING_S = 0.002  # of stiffness
LEAST_GAP = 3e-5  # [rad] below it a gap is smaller than what encoders of arms resolve
TRACKING_GAP = 0.01  # [rad] play of unit amplitude


class Backlash(Deflection):
    """Lost motion: the link is free within a gap, and jumps when the load changes sides."""

    family, number, title = "backlash", 10, "backlash"
    formula = "q_link within q_motor +- b, free between, on a stiff flank beyond"
    source = "Nordin and Gutman 2002, Controlling mechanical systems with backlash"
    excitation = "load reversals, with both sides observed"
    confounded_with = ("joint_elasticity", "transmission_hysteresis", "coulomb_friction")
    parameters = (Parameter("b", "rad", 0.0001, 0.02, "half width of the gap"),)

    def unobservable(self, trial: Trial) -> str | None:
        return None if "tracking" in trial.channels else super().unobservable(trial)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            return (Form("load", ("b",)),) if trial.motion.u is not None else (Form("direction", ("b",)),)
        (joint,) = self.joints_at(trial, place)
        scale = float(trial.scale[joint])
        grid = tuple({"b": b, "K": FLANK * scale, "d": DAMPING_S * FLANK * scale} for b in GAPS)
        limits = {
            "b": (LEAST_GAP, 0.05),
            "K": (20.0 * scale, 5000.0 * scale),
            "d": (1e-3 * scale, 8.0 * scale),
        }
        return (Form("free", ("present",), grid, limits),)

    def angle(self, trial: Trial, joint: int, form: str, shape: Shape, torque: np.ndarray) -> np.ndarray:
        middle = 0.5 * (np.max(torque) + np.min(torque))
        return np.tanh((torque - middle) / (0.1 * np.std(torque) + 1e-12))[None]

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        (joint,) = self.joints_at(trial, place)
        if form == "direction":
            command = trial.motion.command
            assert command is not None and command.position is not None
            path = trial.motion.reduce(command.position)[:, joint]
            return trial.tracking(joint, ((path - play(path, TRACKING_GAP)) / TRACKING_GAP)[None])
        if form == "load":
            return super().columns(trial, place, form, shape)
        angle = trial.motion.reduce(trial.sprung(joint, shape["K"], shape["d"], shape["b"]))
        return trial.link(trial.deflection(joint, angle[None]))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        if form == "free":
            return np.ones(1), np.full(1, 0.05)
        return np.zeros(1), np.full(1, 0.01)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        return bool(amplitudes[0] > 0 or form == "load")

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"b": shape["b"] if form == "free" else float(abs(amplitudes[0]))}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form != "free":
            return None
        joints = self.joints_at(trial, place)
        return {
            "backlash": at_joint(trial, joints, shape["b"]),
            "joint_stiffness": at_joint(trial, joints, shape["K"], np.inf),
            "joint_damping": at_joint(trial, joints, shape["d"]),
        }
