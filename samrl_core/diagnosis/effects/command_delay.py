"""18: command delay."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import FixedResponse
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial, add


class CommandDelay(FixedResponse):
    """What is commanded is done later."""

    family, number, title = "command_delay", 18, "command delay"
    formula = "x(t) = x_in(t - T)"
    source = "PACE bounds 0-25 ms; bus and firmware buffers 1-10 ms"
    acts_on = "command"
    excitation = "steps or chirp, at two gain sets"
    confounded_with = ("command_low_pass", "viscous_friction", "joint_elasticity")
    parameters = (Parameter("T", "s", 0.001, 0.025, "delay"),)

    def places(self, trial: Trial) -> tuple[str, ...]:
        return super().places(trial) + (f"arm:{trial.recording.arm.role}",)

    def unobservable(self, trial: Trial) -> str | None:
        if trial.motion.command is None and trial.motion.u is None:
            return "needs the command or the commanded effort"
        if not trial.motion.dynamic and trial.motion.rate < 20.0:
            return f"sampled at {trial.motion.rate:.0f} Hz, timing needs 20 Hz"
        if set(trial.channels) <= {"link", "dynamics"}:
            return "needs the command, or both commanded and measured effort"
        return None

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        if "tracking" in trial.channels:
            return (
                Form(
                    "tracking",
                    ("present",),
                    tuple({"T": t} for t in (0.01, 0.02, 0.04, 0.08, 0.16)),
                    {"T": (1e-3, 50.0)},
                ),
            )
        forms = []
        grid, limits = tuple({"T": t} for t in (0.001, 0.002, 0.004, 0.008, 0.016, 0.03)), {"T": (5e-4, 0.1)}
        if "controller" in trial.channels:
            forms.append(Form("command", ("present",), grid, limits))
        if "drive" in trial.channels:
            forms.append(Form("effort", ("present",), grid, limits))
        return tuple(forms)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        parts = []
        motion, command, controller = trial.motion, trial.motion.command, trial.recording.arm.controller
        if form == "effort":
            assert motion.raw_commanded is not None
            lost = motion.raw_commanded - _late(trial, motion.raw_commanded, shape)
            parts = [trial.drive(j, lost[:, [j]].T) for j in self.joints_at(trial, place)]
        elif command is not None and command.position is not None:
            lost = command.position - _late(trial, command.position, shape)
            if form == "tracking":
                parts = [
                    trial.tracking(j, motion.reduce(lost[:, [j]]).T) for j in self.joints_at(trial, place)
                ]
            else:
                assert controller is not None and command.velocity is not None and command.effort is not None
                lost = controller.stiffness * lost
                lost = lost + controller.damping * (command.velocity - _late(trial, command.velocity, shape))
                lost = lost + command.effort - _late(trial, command.effort, shape)
                parts = [trial.controller(j, lost[:, [j]].T) for j in self.joints_at(trial, place)]
        return add(*parts)

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        # Less than a sample cannot be told from how the channels are stamped.
        return (
            super().admissible(trial, place, form, shape, amplitudes)
            and shape["T"] > 1.1 / trial.motion.rate
        )

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"T": shape["T"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "tracking":
            return None
        joints = self.joints_at(trial, place)
        if form == "command":
            return {"command_delay": at_joint(trial, joints, shape["T"])}
        return {"effort_delay": at_joint(trial, joints, shape["T"])}


def _late(trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
    return trial.motion.delayed(x, shape["T"])
