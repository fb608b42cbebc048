"""19: packet jitter or loss."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.effects.effect import Form, Parameter, Shape
from samrl_core.diagnosis.effects.families import FixedResponse
from samrl_core.diagnosis.effects.packet_age import HELD, age_at, ages
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.trial import Trial, add

CLEAR = 10.0  # [nat] that holds must win above the compared band: three probabilities are learnt there
MOSTLY = 0.6  # share of samples above which packets are not now and then late, but delayed
UNSEEN = 0.2  # ASSUMPTION: relative deviation of the share by holds too short or too quiet to be told


class PacketJitter(FixedResponse):
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
        age = age_at(trial, place, form, HELD)
        put = trial.controller if form == "command" else trial.drive
        return add(*(put(j, age.lost(trial, form, j)[None]) for j in self.joints_at(trial, place)))

    def cost(self, trials: Sequence[Trial], place: str, form: str, shape: Shape) -> float:
        gains = np.sum([[a.gain for a in ages(trial, form, HELD)] for trial in trials], axis=0)
        alone, together = gains[:-1], float(gains[-1])
        kind, _, name = place.partition(":")
        mine = float(alone[trials[0].recording.arm.joints.index(name)]) if kind == "joint" else together
        # What others deny makes the arm's holds less probable than one joint's; silence does not.
        denied = mine < together + CLEAR if kind == "joint" else together < float(np.max(alone))
        return np.inf if denied or mine < CLEAR else CLEAR

    def admissible(self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray) -> bool:
        rare = age_at(trial, place, form, HELD).late < MOSTLY
        return rare and super().admissible(trial, place, form, shape, amplitudes)

    def physical(
        self, trial: Trial, place: str, form: str, shape: Shape, amplitudes: np.ndarray
    ) -> dict[str, float]:
        age = age_at(trial, place, form, HELD)
        return {"held": age.late, "longest": age.longest(0.5) / age.rate}

    def drawn(
        self,
        trial: Trial,
        place: str,
        form: str,
        shape: Shape,
        amplitudes: np.ndarray,
        rng: np.random.Generator,
    ) -> dict[str, float]:
        """Bursts are few, so their share is uncertain; their ends may be missed."""
        age = age_at(trial, place, form, HELD)
        few = 1.0 / max(1.0, age.bursts)
        # Lengths of bursts are geometric: their sum deviates by twice what their number does, in variance.
        share = age.late * np.exp(np.hypot(UNSEEN, np.sqrt(2.0 * few)) * rng.standard_normal())
        longest = age.longest(rng.uniform())
        return {"held": float(min(share, 1.0)), "longest": (longest + rng.uniform(-0.5, 1.0)) / age.rate}


EFFECT = PacketJitter()
