"""The rules by which a selection becomes a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from samrl_core.diagnosis.result import NamedEffect
from samrl_core.diagnosis.selection.how_far import HowFar
from samrl_core.diagnosis.selection.selection import Selection


@dataclass(frozen=True)
class VerdictSettings:
    """When to name, and when to refuse. Its numbers come from calibration worlds, never from test worlds."""

    unexplained: float = 0.4  # share of the excess that may remain on fitted recordings
    held_out_unexplained: float = 0.65  # likewise on held-out ones, where parameters were not fitted
    visible: float = 25.0  # [nat] excess below which shares say nothing
    worse: float = -0.1  # shrink below which the named effect contradicts held-out recordings
    tie: float = 0.6  # a probability below it is no name
    rival: float = 0.15  # a rival's probability from which on it belongs to the ambiguity set
    no_gap: float = 250.0  # [nat] excess without any effect above threshold that still counts as no gap


@dataclass(frozen=True)
class Decision:
    """Verdict, why, rivals that are tied, and what is left when nothing was chosen."""

    verdict: str
    reasons: tuple[str, ...]
    tied: tuple[str, ...] = ()
    unexplained: float = 0.0


def decide(
    selection: Selection,
    named: Sequence[NamedEffect],
    runner_ups: Sequence[NamedEffect],
    alarms: Sequence[str],
    far: HowFar,
    settings: VerdictSettings,
) -> Decision:
    """Apply the rules in order: no gap, none of mine, ambiguous, effect."""
    if selection.chosen is None:
        if only_held_out(selection, settings):
            return Decision(
                "none_of_mine",
                (
                    f"held-out recordings are {selection.held_out_excess:.0f} nat beyond noise and"
                    " tolerances, the fitted ones are not",
                    "fit a recording of the same kind too",
                ),
                unexplained=1.0,
            )
        if selection.excess < settings.no_gap:
            return Decision(
                "no_gap",
                (
                    "nothing beyond sensor noise and the stated tolerances was found",
                    f"the best effect gains {_best(selection):.1f} nat, {selection.threshold:.1f} are needed",
                ),
            )
        return Decision(
            "none_of_mine",
            (
                f"{selection.excess:.0f} nat of the recordings are beyond noise and tolerances",
                f"no effect of the library reaches {selection.threshold:.1f} nat of evidence",
            ),
            unexplained=1.0,
        )
    reasons, refusals = [], []
    if selection.excess > settings.visible and selection.unexplained > settings.unexplained:
        refusals.append(
            f"{selection.unexplained:.0%} of the gap stays unexplained with {named[0].name}, "
            f"more than {settings.unexplained:.0%}"
        )
    by_chance = any(h.effect.by_chance for h in selection.chosen.hypotheses)
    if selection.held_out_excess > settings.visible and not by_chance:
        left = selection.held_out_unexplained
        if left > settings.held_out_unexplained:
            refusals.append(
                f"on held-out recordings {left:.0%} stay unexplained,"
                f" more than {settings.held_out_unexplained:.0%}"
            )
    elif selection.held_out_remaining > selection.held_out_excess + settings.visible:
        refusals.append("with it, held-out recordings fit worse than without")
    if far.gap is not None and far.gap.shrink is not None and far.gap.shrink < settings.worse:
        refusals.append(f"with it, the gap on held-out recordings grows by {-far.gap.shrink:.0%}")
    refusals += list(alarms)
    if refusals:
        return Decision("none_of_mine", (*refusals, f"nearest is {named[0].name}, which would be wrong"))
    tied = [r.name for r in runner_ups if r.probability > settings.rival]
    if named[0].probability < settings.tie and tied:
        reasons.append(
            f"{named[0].name} ({named[0].probability:.0%}) cannot be told from {', '.join(tied)} here"
        )
        return Decision("ambiguous", tuple(reasons), tuple(tied))
    reasons.append(
        f"{named[0].name} gains {named[0].gain:.0f} nat of evidence; {selection.threshold:.0f} are needed"
    )
    if runner_ups:
        lead = named[0].gain - runner_ups[0].gain
        reasons.append(f"the next best, {runner_ups[0].name}, explains {lead:.0f} nat less")
    if far.gap is not None and far.gap.shrink is not None:
        reasons.append(f"the gap on held-out recordings shrinks by {far.gap.shrink:.0%}")
    return Decision("effect", tuple(reasons))


def only_held_out(selection: Selection, settings: VerdictSettings) -> bool:
    """Whether nothing is seen where it could be fitted, but much where it was not."""
    quiet = selection.chosen is None and selection.excess < settings.no_gap
    return quiet and selection.held_out_excess > settings.no_gap


def _best(selection: Selection) -> float:
    return selection.singles[0].log_evidence if selection.singles else 0.0
