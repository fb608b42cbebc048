"""Whether any recording that was not fitted could confirm a name, and the verdict where none could."""

from __future__ import annotations

from collections.abc import Sequence

from samrl_core.diagnosis.result import NamedEffect
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.decision import Decision, VerdictSettings
from samrl_core.diagnosis.verdict.how_far import HowFar

MOST_OPEN = 2  # effects beside what is named, that are told where no recording confirms it


def nothing_confirms(selection: Selection, far: HowFar, settings: VerdictSettings) -> bool:
    """Whether held-out recordings lack the motion that would show what was chosen.

    A step that is over before they begin, say: the gap there neither shrinks nor grows, whatever is named.
    """
    gap, chosen = far.gap, selection.chosen
    if gap is None or gap.shrink is None or chosen is None:
        return False
    if any(h.effect.by_chance for h in chosen.hypotheses):
        return False
    seen = abs(gap.shrink) >= settings.noticed
    return not seen and selection.held_out_expected < settings.excited * chosen.log_evidence


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
        return Decision("ambiguous", why, others[:MOST_OPEN], unconfirmed=True)
    return Decision("none_of_mine", (*why, f"nearest is {first.name}"), unconfirmed=True)
