"""19: packet jitter or loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samrl_core.diagnosis.effects.drive.packet_age import HELD, Age, ages
from samrl_core.diagnosis.effects.effect import Effect, Parameter, lacks_law
from samrl_core.diagnosis.effects.form import Form, Place, PresentForm, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial, add

CLEAR = 10.0  # [nat] that holds must win above the compared band: three probabilities are learnt there
MOSTLY = 0.6  # share of samples above which packets are not now and then late, but delayed
UNSEEN = 0.2  # ASSUMPTION: relative deviation of the share by holds too short or too quiet to be told


class PacketJitter(Effect):
    """Now and then a command does not arrive, and the last one is held.

    Packets carry all joints: one joint alone is only named where the others deny that they share its holds.
    """

    family, number, title = "packet_jitter", 19, "Late or lost command packets"
    meaning = "Some commands arrive late or never, and the last one is held meanwhile."
    remedy = (
        "Check network, real-time priority and bus load; train or tune with the fitted rate of lost packets."
    )
    formula = "u(t) = u(t_k), t_k the last that arrived"
    source = "1.4-1.7 % of packets late, at most 6.2 ms, measured on a Panda's link"
    acts_on = "command"
    by_chance = True
    simulated = False
    excitation = "any fast motion; stamps"
    confounded_with = ("command_delay",)
    parameters = (
        Parameter("held", "1", 0.005, 0.5, "share of samples in which an old command is held"),
        Parameter("longest", "s", 0.001, 0.02, "longest hold"),
    )

    def acts_on_arm(self, trial: Trial) -> bool:
        return trial.joints > 1

    def why_unobservable(self, trial: Trial) -> str | None:
        if not ({"controller", "drive"} & set(trial.channels)):
            return lacks_law(trial, "needs commanded and measured effort, or the command")
        return (
            None
            if trial.motion.rate > 200.0
            else f"sampled at {trial.motion.rate:.0f} Hz, single packets need 200 Hz"
        )

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        sides = (("controller", "command"), ("drive", "effort"))
        return tuple(
            HeldPackets(name=side, place=place, amplitudes=("present",), side=side)
            for channel, side in sides
            if channel in trial.channels
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class HeldPackets(PresentForm):
    """The last packet of a stream is held until the next arrives."""

    freedom: ClassVar[float] = 0.1
    side: str  # stream: command or effort

    def age(self, trial: Trial) -> Age:
        """Age of the packets of the place."""
        return ages(trial, self.side, HELD)[self.place.index]

    def columns(self, trial: Trial, shape: Shape) -> Columns:
        age = self.age(trial)
        put = trial.controller if self.side == "command" else trial.drive
        return add(*(put(j, age.lost(trial, self.side, j)[None]) for j in self.place.joints))

    def cost(self, trials: Sequence[Trial], shape: Shape) -> float:
        found = np.sum([[a.log_evidence for a in ages(t, self.side, HELD)] for t in trials], axis=0)
        alone, together = found[:-1], float(found[-1])
        mine = float(found[self.place.index])
        # What others deny makes the arm's holds less probable than one joint's; silence does not.
        denied = together < float(np.max(alone)) if self.place.is_arm else mine < together + CLEAR
        return np.inf if denied or mine < CLEAR else CLEAR

    def is_possible(self, trial: Trial, shape: Shape) -> bool:
        return self.age(trial).late < MOSTLY

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        age = self.age(trial)
        return {"held": age.late, "longest": age.longest(0.5) / age.rate}

    def sample_parameters(
        self, trial: Trial, shape: Shape, amplitudes: np.ndarray, rng: np.random.Generator
    ) -> dict[str, float]:
        """Bursts are few, so their share is uncertain; their ends may be missed."""
        age = self.age(trial)
        few = 1.0 / max(1.0, age.bursts)
        # Lengths of bursts are geometric: their sum deviates by twice what their number does, in variance.
        share = age.late * np.exp(np.hypot(UNSEEN, np.sqrt(2.0 * few)) * rng.standard_normal())
        longest = age.longest(rng.uniform())
        return {"held": float(min(share, 1.0)), "longest": (longest + rng.uniform(-0.5, 1.0)) / age.rate}


EFFECT = PacketJitter()
