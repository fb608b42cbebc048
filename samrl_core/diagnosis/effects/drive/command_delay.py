"""18: command delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape, at_joint
from samrl_core.diagnosis.effects.families import LateResponse, clearest_delay
from samrl_core.diagnosis.effects.packet_age import WANDERING, age_at, usual_age
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial, add

CLEAR = 10.0  # [nat] that a delay which changes must win, above the compared band, against a constant one
ALWAYS = 0.8  # share of samples that must be late: fresh packets with some late ones are jitter
JITTERY = "wandering"


class CommandDelay(LateResponse):
    """What is commanded is done later; by a constant time, or by one that drifts and jumps about its mean."""

    family, number, title = "command_delay", 18, "Command delay"
    meaning = "The command takes effect later than the model believes, by a fixed time."
    remedy = (
        "Add the delay to the model or shorten the chain (bus cycle, buffers, middleware); lower gains if it "
        "cannot be helped."
    )
    formula = "x(t) = x_in(t - T), T constant or T(t)"
    source = "PACE bounds 0-25 ms; bus and firmware buffers 1-10 ms, which fill and empty"
    excitation = "steps or chirp, at two gain sets"
    experiment = "chirp"
    confounded_with = ("command_low_pass", "viscous_friction", "joint_elasticity")
    parameters = (Parameter("T", "s", 0.001, 0.025, "delay, its mean where it wanders"),)
    symbol = "T"
    grid = (0.001, 0.002, 0.004, 0.008, 0.016, 0.03)
    limits = (5e-4, 0.1)
    tracking_grid = (0.01, 0.02, 0.04, 0.08, 0.16)

    def forms(self, trial: Trial, place: str) -> tuple[Form, ...]:
        """Where single samples show a delay of two or more, it may also wander."""
        constant = super().forms(trial, place)
        if any(form.name == "effort" for form in constant):
            # Detail fixes a delay to a part of a sample: too narrow to be met by a search from afar.
            clearest = clearest_delay(trial, self.joints_at(trial, place))
            more = ({"T": clearest},) if clearest * trial.motion.rate > 1.0 else ()
            constant = tuple(
                replace(form, shapes=form.shapes + more) if form.name == "effort" else form
                for form in constant
            )
        offered = [
            f"{form.name} {JITTERY}"
            for form in constant
            if form.name != "tracking" and usual_age(trial, place, form.name) > 1
        ]
        return constant + tuple(Form(name, ("present",)) for name in offered)

    def late(self, trial: Trial, x: np.ndarray, form: str, shape: Shape) -> np.ndarray:
        return trial.motion.delayed(x, shape["T"])

    def columns(self, trial: Trial, place: str, form: str, shape: Shape) -> Columns:
        where, _, wanders = form.partition(" ")
        if not wanders:
            return super().columns(trial, place, form, shape)
        age = age_at(trial, place, where, WANDERING)
        put = trial.controller if where == "command" else trial.drive
        return add(*(put(j, age.lost(trial, where, j)[None]) for j in self.joints_at(trial, place)))

    def cost(self, trials: Sequence[Trial], place: str, form: str, shape: Shape) -> float:
        where, _, wanders = form.partition(" ")
        if not wanders:
            return super().cost(trials, place, form, shape)
        gain = sum(age_at(trial, place, where, WANDERING).gain for trial in trials)
        return CLEAR if gain > CLEAR else np.inf

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        where, _, wanders = form.partition(" ")
        if wanders and age_at(trial, place, where, WANDERING).late < ALWAYS:
            return False
        # Less than a sample cannot be told from how the channels are stamped.
        long = self.physical(trial, place, form, shape, amplitudes)["T"] > 1.1 / trial.motion.rate
        return super().admissible(trial, place, form, shape, amplitudes) and long

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        where, _, wanders = form.partition(" ")
        return {"T": age_at(trial, place, where, WANDERING).mean_s if wanders else shape["T"]}

    def drawn(
        self,
        trial: Trial,
        place: str,
        form: str,
        shape: Shape,
        amplitudes: np.ndarray,
        rng: np.random.Generator,
    ) -> dict[str, float]:
        """Tracked ages are whole samples: the mean is known to half of one."""
        drawn = self.physical(trial, place, form, shape, amplitudes)["T"]
        whole = rng.uniform(-0.5, 0.5) / trial.motion.rate if form.endswith(JITTERY) else 0.0
        return {"T": drawn + whole}

    def plant(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, np.ndarray | float] | None:
        if form == "tracking":
            return None
        joints = self.joints_at(trial, place)
        delay = self.physical(trial, place, form, shape, amplitudes)["T"]
        field = "command_delay" if form.startswith("command") else "effort_delay"
        return {field: at_joint(trial, joints, delay)}


EFFECT = CommandDelay()
