"""What no effect of the library does is told from the effect that resembles it, and from nothing at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.diagnosis.effects import FAMILIES
from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.verdict.foils import Foils
from tests.diagnosis.worlds import JOINTS, LIFT, TURN, trials, world

K, NEEDED = 4.0, 12.0  # samples that count as one, and log evidence that an effect needs [nat]

Lost = Callable[[np.ndarray, np.ndarray], np.ndarray]  # speeds and link torques (N, J) -> torque (N,)
LAWS: dict[str, Lost] = {
    "nothing": lambda v, tau: 0.0 * v[:, LIFT],
    "viscous": lambda v, tau: 2.0 * v[:, LIFT],
    "nearly viscous": lambda v, tau: 2.0 * np.sign(v[:, LIFT]) * np.abs(v[:, LIFT]) ** 0.87,
    "square": lambda v, tau: 2.0 * v[:, LIFT] * np.abs(v[:, LIFT]),
    "eddy currents": lambda v, tau: 3.0 * (v[:, LIFT] / 0.2) / (1.0 + (v[:, LIFT] / 0.2) ** 2),
    "falling": lambda v, tau: (0.5 + 1.5 * np.exp(-np.abs(v[:, LIFT]) / 0.15)) * np.tanh(v[:, LIFT] / 0.005),
    "cross-talk": lambda v, tau: 0.1 * tau[:, TURN],
}


@cache
def nominal() -> list[ArmRecording]:
    return world(11, "BC")


def losing(recording: ArmRecording, law: str) -> ArmRecording:
    """The recording of a motor that moves alike and had to give so much more at the lift."""
    states, given = recording.states, recording.commanded_effort
    assert states.velocity is not None and states.effort is not None
    assert given is not None and given.effort is not None
    effort = given.effort.copy()
    effort[:, LIFT] += LAWS[law](states.velocity, states.effort)
    return replace(recording, commanded_effort=replace(given, effort=effort))


@cache
def likelihoods(law: str) -> tuple[Likelihood, Likelihood]:
    *fitted, held_out = trials([losing(r, law) for r in nominal()])
    return Likelihood(fitted), Likelihood([held_out])


def best(evidence: Evidence, family: str) -> Fit:
    effect = FAMILIES[family]
    assert isinstance(effect, Effect)
    fits = [evidence.fit([h]) for h in evidence.screen([effect]) if h.place == f"joint:{JOINTS[LIFT]}"]
    return evidence.refine(max(fits, key=lambda f: f.log_evidence), 0)


@pytest.mark.parametrize(
    ("law", "family", "says"),
    [
        ("viscous", "viscous_friction", ""),
        ("nearly viscous", "viscous_friction", ""),
        ("falling", "stribeck_friction", ""),
        ("square", "viscous_friction", "a drag by the square of speed"),
        ("eddy currents", "stribeck_friction", "a brake that fades at speed"),
        ("cross-talk", "viscous_friction", "a share of the torque of turn"),
    ],
)
def test_a_law_of_no_family_is_told_from_the_effect_that_resembles_it(
    law: str, family: str, says: str
) -> None:
    """A drag by the square of speed was viscous friction with 3081 of log evidence, eddies Stribeck's."""
    fitted, held_out = likelihoods(law)
    evidence = Evidence(fitted, K)
    doubts = Foils(fitted, held_out).doubts(evidence, best(evidence, family), NEEDED)
    assert [d.partition(": ")[2].partition(" explains")[0] for d in doubts] == ([says] if says else [])


@pytest.mark.parametrize(("law", "gap"), [("nothing", False), ("cross-talk", True)])
def test_a_gap_that_only_a_foil_explains_is_one(law: str, gap: bool) -> None:
    """A shoulder that lost 0.11 of the elbow's torque had no gap: no effect gained more than 8."""
    fitted, held_out = likelihoods(law)
    doubts = Foils(fitted, held_out).doubts(Evidence(fitted, K), None, NEEDED)
    assert bool(doubts) is gap
