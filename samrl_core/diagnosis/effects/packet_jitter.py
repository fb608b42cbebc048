"""19: packet jitter or loss."""

from __future__ import annotations

import numpy as np
from scipy import signal

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape
from samrl_core.diagnosis.effects.families import FixedResponse
from samrl_core.diagnosis.equations import Columns
from samrl_core.diagnosis.trial import Trial, add


class PacketJitter(FixedResponse):
    """Now and then a command does not arrive, and the last one is held."""

    family, number, title = "packet_jitter", 19, "packet jitter or loss"
    formula = "u(t) = u(t_k), t_k the last that arrived"
    source = "1.4-1.7 % of packets late, at most 6.2 ms, measured on a Panda's link"
    acts_on = "command"
    by_chance = True
    freedom = 0.1
    excitation = "any fast motion; stamps"
    confounded_with = ("command_delay",)
    parameters = (
        Parameter("held", "1", 0.005, 0.5, "share of samples in which an old command is held"),
        Parameter("longest", "s", 0.001, 0.02, "longest hold"),
    )

    def places(self, trial: Trial) -> tuple[str, ...]:
        return super().places(trial) + (f"arm:{trial.recording.arm.role}",)

    def unobservable(self, trial: Trial) -> str | None:
        if not ({"controller", "drive"} & set(trial.channels)):
            return "needs commanded and measured effort, or the command"
        return (
            None
            if trial.motion.rate > 200.0
            else f"sampled at {trial.motion.rate:.0f} Hz, single packets need 200 Hz"
        )

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        forms = []
        if "controller" in trial.channels:
            forms.append(Form("command", ("present",)))
        if "drive" in trial.channels:
            forms.append(Form("effort", ("present",)))
        return tuple(forms)

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        parts = []
        for j in self.joints_at(trial, place):
            lost, _ = _holds(trial, j, form)
            parts.append(trial.controller(j, lost[None]) if form == "command" else trial.drive(j, lost[None]))
        return add(*parts)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        ages = np.concatenate([_holds(trial, j, form)[1] for j in self.joints_at(trial, place)])
        return {"held": float(np.mean(ages > 0)), "longest": float(np.max(ages)) / trial.motion.rate}


def _holds(trial: Trial, joint: int, form: str) -> tuple[np.ndarray, np.ndarray]:
    """Found once per recording: many places and draws ask for the same."""
    key = (PacketJitter.family, joint, form)
    if key not in trial.kept:
        trial.kept[key] = _find_holds(trial, joint, form)
    return trial.kept[key]


def _find_holds(trial: Trial, joint: int, form: str, longest: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Torque lost to holds (F,), and the age of the held value in samples (F,), as the residual shows them.

    A sample counts as held only where the residual stands clear of its own detail noise and an older value
    explains it; when most samples are late it is a delay, not jitter, and nothing is returned.
    """
    motion = trial.motion
    if form == "command":
        law, u = trial.equations.law, motion.raw_commanded
        command, controller = motion.command, trial.recording.arm.controller
        assert law is not None and u is not None and command is not None and controller is not None
        assert command.position is not None and command.velocity is not None
        residual = law[:, joint] - u[:, joint]
        stream = controller.stiffness[joint] * command.position[:, joint]
        stream = stream + controller.damping[joint] * command.velocity[:, joint]
    else:
        assert motion.raw_commanded is not None and motion.raw_effort is not None
        residual = motion.raw_commanded[:, joint] - motion.raw_effort[:, joint]
        residual = residual - trial.rotor[joint] * motion.full_acceleration[:, joint]
        residual = residual - signal.medfilt(residual, 51)
        stream = motion.raw_commanded[:, joint]
    noise = 1.4826 * float(np.median(np.abs(residual - np.median(residual)))) + 1e-9
    lost, ages = np.zeros(len(residual)), np.zeros(len(residual))
    best = np.abs(residual)
    clear = best > 5.0 * noise
    for age in range(1, longest + 1):
        old = stream - np.concatenate([np.full(age, stream[0]), stream[:-age]])
        error = np.abs(residual - old)
        better = clear & (error < best) & (error < 3.0 * noise)
        lost[better], ages[better], best[better] = old[better], age, error[better]
    if np.mean(ages > 0) > 0.6:
        return np.zeros_like(lost), np.zeros_like(ages)
    return lost, ages
