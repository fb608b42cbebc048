"""Laws that no effect of the library has, which recordings may speak for more than for what is named.

A law outside the library still resembles one inside: fitted to a sine, a line leaves 4 % of a drag that grows
with the square of speed, which is what a known law of another formula leaves. So no share of what is left
tells them apart, but the likelihood ratio of the two laws does, as they cannot both be right (Cox 1961,
Tests of separate families of hypotheses). A foil is never a cause: where it explains more, and foretells
recordings that were never fitted, nothing of the library is named.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from samrl_core.diagnosis.effects.drive_torque import DriveEffect, DriveForm, fastest_motion
from samrl_core.diagnosis.effects.effect import Parameter
from samrl_core.diagnosis.effects.form import Form, Place, Shape
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis, hypothesis
from samrl_core.diagnosis.selection.on_held_out import SHOWN, held_out_gains
from samrl_core.diagnosis.selection.selection import WIDE
from samrl_core.diagnosis.selection.settings import SelectionSettings

TURNS = (0.04, 0.1, 0.25, 0.6)  # of the fastest motion, at which a brake of eddy currents is strongest
SHAPES_TRIED = 15  # of the best one
BETTER = 10.0  # [nat] that a foil must explain beyond what is named: it is less likely before any data
NOTED = 0.0025  # of what is named, likewise: within a quarter of a percent two formulas are tied
CERTAIN = 8.0  # times what an effect needs, where none is believed: such a gap must be beyond any chance
FORETOLD = 0.5  # of what it should win on held-out recordings: noise in a regressor wins half there

Law = Callable[[Trial, int, Shape], np.ndarray]  # recording, joint, shape -> lost torque (F,) per unit


@dataclass(frozen=True, eq=False, kw_only=True)
class FoilForm(DriveForm):
    """A torque at one joint in proportion to one amplitude."""

    law: Law
    brakes: bool = False

    def torque(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        """Lost torque (1, F)."""
        return self.law(trial, joint, shape)[None]

    def spread(self, trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        """A tenth of the joint's effort, as for frictions."""
        lost = self.law(trial, joint, shape)
        return np.array([0.1 * trial.scale[joint] / max(float(np.sqrt(np.mean(lost**2))), 1e-9)])

    def is_admissible(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> bool:
        """A law of speed brakes."""
        return not self.brakes or bool(amplitudes[0] > 0.0)

    def parameters(self, trial: Trial, shape: Shape, amplitudes: np.ndarray) -> dict[str, float]:
        """Its only size, of no family."""
        return {self.amplitudes[0]: float(amplitudes[0])}


class Foil(DriveEffect):
    """All of them as one effect of no family: no number, and no report names it as a cause."""

    family, number, title = "foil", 0, "Law of no family"
    meaning = remedy = formula = source = excitation = ""
    parameters: tuple[Parameter, ...] = ()

    def forms(self, trial: Trial, place: Place) -> tuple[Form, ...]:
        """Laws of speed, and each other joint's torque, as a sensor's or a motor's cross-talk is."""
        (joint,) = place.joints
        fastest = fastest_motion(trial, place.joints)
        peaks = tuple({"v": part * fastest} for part in TURNS)
        drag = FoilForm(
            name="a drag by the square of speed", place=place, amplitudes=("c",), law=_drag, brakes=True
        )
        brake = FoilForm(
            name="a brake that fades at speed", place=place, amplitudes=("b",), law=_brake, brakes=True,
            shapes=peaks, refine={"v": (0.5 * TURNS[0] * fastest, fastest)},
        )  # fmt: skip
        made = [drag, brake]
        if trial.rigid is not None and trial.motion.dynamic:
            made += [
                FoilForm(
                    name=f"a share of the torque of {name}", place=place, amplitudes=("c",), law=_torque_of(i)
                )
                for i, name in enumerate(trial.recording.arm.joints)
                if i != joint
            ]  # fmt: skip
        return tuple(made)


def _drag(trial: Trial, joint: int, shape: Shape) -> np.ndarray:
    speed = trial.motion.sure_velocity[:, joint]
    return speed * np.abs(speed)


def _brake(trial: Trial, joint: int, shape: Shape) -> np.ndarray:
    """Torque of eddy currents: it grows with speed to a peak, and falls beyond."""
    ratio = trial.motion.sure_velocity[:, joint] / shape["v"]
    return ratio / (1.0 + ratio**2)


def _torque_of(other: int) -> Law:
    def law(trial: Trial, joint: int, shape: Shape) -> np.ndarray:
        return trial.delivered_torque[:, other]

    return law


FOIL = Foil()


class Foils:
    """What foils explain of one system's recordings."""

    def __init__(self, fitted: Likelihood, held_out: Likelihood) -> None:
        """Nothing is evaluated yet."""
        self._fitted, self._held_out = fitted, held_out

    @cached_property
    def _pool(self) -> list[Hypothesis]:
        if self._fitted.exact or not self._held_out.blocks:
            return []
        return Evidence(self._fitted).screen([FOIL])

    def doubts(self, evidence: Evidence, chosen: Fit | None, least: float) -> list[str]:
        """Why nothing may be named, or no gap be said: a foil that explains more (`Kind.doubts`)."""
        if not self._pool or (chosen is not None and any(h.effect.by_chance for h in chosen.hypotheses)):
            return []
        fit = max((self._beside(evidence, h, chosen) for h in self._pool), key=lambda f: f.log_evidence)
        fit = evidence.refine(fit, 0, SHAPES_TRIED)
        law = fit.hypotheses[0]
        won, expected = held_out_gains(self._held_out, fit, evidence.correlation_time)
        if not (expected >= SHOWN and won >= FORETOLD * expected):
            return []
        says = f"{law.place}: {law.form.name} explains"
        there = f"and {won:.0f} of {expected:.0f} as foretold on held-out ones; no effect of the library does"
        if chosen is None:
            enough = fit.log_evidence >= CERTAIN * least and self._stands_wide(evidence, law)
            return [f"{says} {fit.log_evidence:.0f} of log evidence, {there}"] if enough else []
        more = fit.log_evidence - chosen.log_evidence
        foretells = won > held_out_gains(self._held_out, chosen, evidence.correlation_time)[0]
        if more < max(BETTER, NOTED * chosen.log_evidence) or not foretells:
            return []
        return [f"{says} {more:.0f} of log evidence more than {chosen.hypotheses[0].name}, {there}"]

    def _beside(self, evidence: Evidence, law: Hypothesis, chosen: Fit | None) -> Fit:
        """The chosen set with its first effect exchanged for a foil, or the foil alone if better."""
        alone = evidence.fit([law])
        if chosen is None or len(chosen.hypotheses) == 1:
            return alone
        return max(alone, evidence.fit([law, *chosen.hypotheses[1:]]), key=lambda f: f.log_evidence)

    def _stands_wide(self, evidence: Evidence, law: Hypothesis) -> bool:
        """Whether tolerances twice as wide leave it believed, as of an effect."""
        wide = Evidence(Likelihood(self._fitted.trials, WIDE), evidence.correlation_time)
        there = hypothesis(wide.likelihood, law.effect, law.form, law.shape)
        return there is not None and wide.fit([there]).log_evidence >= SelectionSettings().wide_threshold
