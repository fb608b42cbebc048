"""20: controller gain."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect, Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial, add


class ControllerGain(Effect):
    """The controller's gains are not those that it is described with."""

    family, number, title = "controller_gain", 20, "controller gain"
    formula = "u = (1 + eK) K (q_d - q) + (1 + eD) D (dq_d - dq) + ..."
    source = "gains scaled in firmware; +-30 %"
    acts_on = "dynamics"
    excitation = "steps, at two gain sets"
    confounded_with = ("actuator_gain", "reflected_inertia")
    parameters = (
        Parameter("eK", "1", -0.5, 0.5, "relative error of the stiffness"),
        Parameter("eD", "1", -0.5, 0.5, "relative error of the damping"),
    )

    def places(self, trial: Trial) -> tuple[str, ...]:
        return super().places(trial) + (f"arm:{trial.recording.arm.role}",)

    def unobservable(self, trial: Trial) -> str | None:
        return (
            None
            if "controller" in trial.channels
            else "needs command, commanded effort and the described controller"
        )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        return (Form("gains", ("eK", "eD")),)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        motion, command, controller = trial.motion, trial.motion.command, trial.recording.arm.controller
        assert command is not None and command.position is not None and command.velocity is not None
        assert controller is not None and motion.raw_position is not None
        speed = motion.raw_velocity if motion.raw_velocity is not None else motion.full_velocity
        spring = controller.stiffness * (command.position - motion.raw_position)
        damper = controller.damping * (command.velocity - speed)
        rows = -np.stack([spring, damper])
        return add(*(trial.controller(j, rows[:, :, j]) for j in self.joints_at(trial, place)))

    def prior(self, trial: Trial, place: str, form: str, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(2), np.full(2, 0.3)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"eK": float(amplitudes[0]), "eD": float(amplitudes[1])}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        joints = self.joints_at(trial, place)
        return {
            "stiffness_scale": at_joint(trial, joints, 1.0 + amplitudes[0], 1.0),
            "damping_scale": at_joint(trial, joints, 1.0 + amplitudes[1], 1.0),
        }
