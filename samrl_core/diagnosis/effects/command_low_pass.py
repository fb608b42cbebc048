"""17: command low-pass."""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import FixedResponse
from samrl_core.diagnosis.effects.shapes import low_passed
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial, add


class CommandLowPass(FixedResponse):
    """A first-order filter between what is commanded and what is done."""

    family, number, title = "command_low_pass", 17, "command low-pass"
    formula = "x' = 2 pi fc (x_in - x)"
    source = "libfranka: cutoff 100 Hz by default, up to 1000 Hz"
    acts_on = "command"
    excitation = "chirp to 10-30 Hz"
    confounded_with = ("command_delay", "joint_elasticity", "torque_rate_limit")
    parameters = (Parameter("fc", "Hz", 0.5, 100.0, "cutoff frequency"),)

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
                    tuple({"fc": f} for f in (0.5, 1.0, 2.0, 4.0, 8.0)),
                    {"fc": (1e-3, 50.0)},
                ),
            )
        forms = []
        grid, limits = tuple({"fc": f} for f in (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)), {"fc": (0.2, 200.0)}
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

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        return {"fc": shape["fc"]}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "tracking":
            return None
        joints = self.joints_at(trial, place)
        if form == "command":
            return {"command_cutoff": at_joint(trial, joints, shape["fc"], np.inf)}
        return {"effort_cutoff": at_joint(trial, joints, shape["fc"], np.inf)}


def _late(trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
    return low_passed(x, shape["fc"], trial.motion.rate)
