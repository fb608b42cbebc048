"""Whether any recording that was not fitted could confirm a name, and the verdict where none could."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import NamedEffect
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.decision import Decision, VerdictSettings
from samrl_core.diagnosis.verdict.how_far import HowFar

SOME = 0.01  # of what the recording that shows most is worth
MOST_OPEN = 2  # effects beside what is named, that are told where no recording confirms it


def nothing_confirms(
    fitted: Likelihood, selection: Selection, far: HowFar, settings: VerdictSettings
) -> bool:
    """Whether one fitted recording alone shows what was chosen, and no held-out one could.

    A step that is over before the held-out part begins, say: the gap there neither shrinks nor grows,
    whatever is named. Several fitted recordings confirm each other: the effect's sizes in them are compared.
    """
    gap, chosen = far.gap, selection.chosen
    if gap is None or gap.shrink is None or chosen is None:
        return False
    if any(h.effect.by_chance for h in chosen.hypotheses):
        return False
    could = selection.held_out_expected >= settings.excited * chosen.log_evidence
    if could or abs(gap.shrink) >= settings.noticed:
        return False
    return len(find_showing(fitted, chosen, selection.correlation_time, settings.shown)) < 2


def find_showing(fitted: Likelihood, chosen: Fit, correlation: float, least: float) -> list[int]:
    """Fitted recordings in which a set is worth so much log likelihood [nat], and some of the most."""
    prediction = np.zeros(len(fitted.y))
    for h, amplitudes in zip(chosen.hypotheses, chosen.amplitudes, strict=True):
        prediction += fitted.prediction(h.regressors, amplitudes)
    weighed = prediction * (prediction - fitted.tolerated(prediction, correlation)) / (2.0 * correlation)
    worth = np.zeros(len(fitted.trials))
    for (recording, _, _), part in fitted.blocks.items():
        worth[recording] += np.sum(weighed[part])
    return np.flatnonzero(worth >= max(least, SOME * float(np.max(worth)))).tolist()


def not_confirmed(selection: Selection, first: NamedEffect, runner_ups: Sequence[NamedEffect]) -> Decision:
    """The verdict where held-out recordings can say nothing of a name: what else was believed stays open."""
    why = (
        f"held-out recordings lack the motion that shows {first.name}: of its {first.gain:.0f} of log"
        f" evidence {selection.held_out_expected:.1f} could show there, so nothing confirms it",
        "record that motion twice, one of them to hold out, or log it longer: the cut must leave it on both"
        " sides",
    )
    others = tuple(r.name for r in runner_ups if r.gain >= selection.threshold)
    if others:
        return Decision("ambiguous", why, others[:MOST_OPEN])
    return Decision("none_of_mine", (*why, f"nearest is {first.name}"))
