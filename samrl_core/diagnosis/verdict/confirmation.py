"""Whether any recording that was not fitted could confirm a name, and the verdict where none could."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.decision import Decision, VerdictSettings
from samrl_core.diagnosis.verdict.how_far import HowFar

SOME = 0.05  # of what the largest event is worth: a filter rings beside it
NEAR = 0.5  # of its evidence, from which on a rival explains nearly as much
MOST_OPEN = 2  # effects beside what is named, that are told where no recording confirms it


def nothing_confirms(
    fitted: Likelihood, selection: Selection, far: HowFar, settings: VerdictSettings
) -> bool:
    """Whether what was chosen shows in one event of the fitted recordings, and in none of the held-out ones.

    A step that is over before the held-out part begins, say: the gap there neither shrinks nor grows,
    whatever is named. Several events confirm each other: the effect's sizes in them are compared.
    """
    gap, chosen = far.gap, selection.chosen
    if gap is None or gap.shrink is None or chosen is None:
        return False
    if any(h.effect.by_chance for h in chosen.hypotheses):
        return False
    could = selection.held_out_expected >= settings.excited * chosen.log_evidence
    if could or abs(gap.shrink) >= settings.noticed or _is_told_from_rival(selection, chosen, gap, settings):
        return False
    return count_events(fitted, chosen, selection.correlation_time, settings.shown) < 2


def _is_told_from_rival(
    selection: Selection, chosen: Fit, gap: HeldOutGap, settings: VerdictSettings
) -> bool:
    """Whether held-out recordings refute who else explains the fitted ones nearly as well.

    A limit of the torque that is not reached there is right; a limit of its rate would be seen.
    """
    near = (r for r in selection.rivals if r.log_evidence >= NEAR * chosen.log_evidence)
    names = {r.hypotheses[0].name for r in near}
    return gap.runner_up_effect in names and gap.margin is not None and gap.margin >= settings.closer


def count_events(fitted: Likelihood, chosen: Fit, correlation: float, least: float) -> int:
    """Stretches of one sign that a set predicts in a joint's channel, each worth so much and not little.

    Of the joint and channel that has most of them in each recording: all may answer one motion.

    Args:
        fitted: of the fitted recordings.
        chosen: the set.
        correlation: samples that count as one.
        least: log likelihood [nat] that an event must be worth.
    """
    prediction = np.zeros(len(fitted.y))
    for h, amplitudes in zip(chosen.hypotheses, chosen.amplitudes, strict=True):
        prediction += fitted.prediction(h.regressors, amplitudes)
    weighed = prediction * (prediction - fitted.tolerated(prediction, correlation)) / (2.0 * correlation)
    worth = {}
    for block, part in fitted.blocks.items():
        turns = np.flatnonzero(np.diff(np.signbit(prediction[part]))) + 1
        worth[block] = np.array([np.sum(piece) for piece in np.split(weighed[part], turns)])
    enough = max(least, SOME * max((float(np.max(w)) for w in worth.values()), default=0.0))
    most = np.zeros(len(fitted.trials), dtype=int)
    for (recording, _, _), pieces in worth.items():
        most[recording] = max(most[recording], np.count_nonzero(pieces >= enough))
    return int(np.sum(most))


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
