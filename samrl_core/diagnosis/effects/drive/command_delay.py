"""18: command delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samrl_core.cell.types.arm_recording import JointSignal
from samrl_core.diagnosis.effects.drive.late_response import (
    LateForm,
    LateResponse,
    clearest_delay,
    clearest_delay_of_law,
    late_sides,
)
from samrl_core.diagnosis.effects.drive.packet_age import WANDERING, Age, ages, usual_age
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, PlantFields, PresentForm, Shape
from samrl_core.diagnosis.residuals.equations import LATEST_IN_LAW_S, Columns, latest_delay
from samrl_core.diagnosis.residuals.laws.tracked_command import find_delays_alike
from samrl_core.diagnosis.residuals.trial import Trial, add

CLEAR = 10.0  # [nat] that a delay which changes must win, above the compared band, against a constant one
ALWAYS = 0.8  # share of samples that must be late: fresh packets with some late ones are jitter
GRID = (0.001, 0.002, 0.004, 0.008, 0.016, 0.03, 0.06)  # [s]
LIMITS = (5e-4, LATEST_IN_LAW_S)  # [s]
SHORTEST = 0.6  # samples of a delay before a law: half of one lies within what stamps may be off by
TRACKED_GRID = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)  # [s] of servos that only log where they are


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

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """Where single samples show a delay of two or more, it may also wander."""
        if "tracking" in trial.channels:
            latest = latest_delay(trial.motion)
            grid, limits = tuple({"T": t} for t in TRACKED_GRID if t < latest), {"T": (1e-3, latest)}
            return (ConstantDelay(name="tracking", place=place, side="tracking", shapes=grid, refine=limits),)
        sides = late_sides(trial)
        constant = []
        for side in sides:
            # In the middle of those that are alike: at their edge a delay is as near to others.
            near = dict.fromkeys(float(np.mean(_delays_alike(trial, side, t))) for t in GRID)
            grid = tuple({"T": t} for t in near)
            # Detail fixes a delay to a part of a sample, a law that its limit cuts to a tick or two: too
            # narrow to be met by a search from afar.
            find = clearest_delay if side == "effort" else clearest_delay_of_law
            if (clearest := find(trial, place.joints)) * trial.motion.rate > 1.0:
                grid += ({"T": clearest},)
            constant.append(
                ConstantDelay(name=side, place=place, side=side, shapes=grid, refine={"T": LIMITS})
            )
        wandering = (
            WanderingDelay(name=f"{side} wandering", place=place, amplitudes=("present",), side=side)
            for side in sides
            if usual_age(trial, place, side) > 1
        )
        return (*constant, *wandering)


class ConstantDelay(LateForm):
    """A constant delay: all of a signal is late, and by that alone.

    A share of it, which a filter has to be given, would trade against the delay: to first order torques tell
    their product. Stamps that are off make a late command noisy, so that less of it, later, fits better.
    """

    freedom: ClassVar[float] = 0.003

    def late(self, trial: Trial, x: np.ndarray, shape: Shape) -> np.ndarray:
        return trial.motion.delayed(x, shape["T"])

    def late_command(self, trial: Trial, command: JointSignal, shape: Shape) -> JointSignal:
        """Of the stamps themselves: held goals stay stairs, and rows that lack are no neighbours'."""
        told = trial.motion.recorded_command
        late = None if told is None else trial.motion.as_tracked(told, shape["T"])
        assert late is not None
        return late

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        # A law reads its command with the position: a dead band, a punch or a limit tells a delay to a part
        # of a sample, where stamps off by as much would not do. Else their tolerance explains it.
        if self.side == "command":
            return _delays_alike(trial, self.side, shape["T"])[1] * trial.motion.rate > SHORTEST
        return _is_seen(trial, shape["T"])

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"T": float(np.mean(_delays_alike(trial, self.side, shape["T"])))}

    def sample_parameters(
        self, trial: Trial, shape: Shape, amplitudes: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """Each of those that are alike is as probable."""
        return {"T": rng.uniform(*_delays_alike(trial, self.side, shape["T"]))}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        if self.side == "tracking":
            return None
        return {f"{self.side}_delay": self.at_joints(trial, self.parameters(trial, shape, amplitudes)["T"])}


@dataclass(frozen=True, eq=False, kw_only=True)
class WanderingDelay(PresentForm):
    """A delay that drifts and jumps about its mean, tracked sample by sample."""

    side: str  # stream: command or effort

    def age(self, trial: Trial) -> Age:
        """Age of the packets of the place."""
        return ages(trial, self.side, WANDERING)[self.place.index]

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        age = self.age(trial)
        put = trial.controller if self.side == "command" else trial.drive
        return add(*(put(j, age.lost(trial, self.side, j)[None]) for j in self.place.joints))

    def cost(self, trials: Sequence[Trial], shape: Shape) -> float:
        return CLEAR if sum(self.age(trial).log_evidence for trial in trials) > CLEAR else np.inf

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        age = self.age(trial)
        return age.late >= ALWAYS and _is_seen(trial, age.mean_s)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        return {"T": self.age(trial).mean_s}

    def sample_parameters(
        self, trial: Trial, shape: Shape, amplitudes: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """Tracked ages are whole samples: the mean is known to half of one."""
        return {"T": self.age(trial).mean_s + rng.uniform(-0.5, 0.5) / trial.motion.rate}

    def plant_fields(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> PlantFields | None:
        return {f"{self.side}_delay": self.at_joints(trial, self.age(trial).mean_s)}


def _delays_alike(trial: Trial, side: str, late: float) -> tuple[float, float]:
    """Delays [s], from and to, that a recording cannot tell from this one, whatever its noise."""
    told = trial.motion.recorded_command
    return (late, late) if side != "command" or told is None else find_delays_alike(trial.motion, told, late)


def _is_seen(trial: Trial, delay: float) -> bool:
    """Less than a sample cannot be told from how the channels are stamped."""
    return delay > 1.1 / trial.motion.rate


EFFECT = CommandDelay()
