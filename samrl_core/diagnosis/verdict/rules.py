"""The rules by which a selection becomes a verdict.

A formula that leaves much of the torque unexplained is refused, as an unknown effect would be the reason. A
real machine, though, has smaller effects beside its dominant one. That one is named, with the share that it
leaves, where simulation says the same as the regression: the motion on held-out recordings comes much closer,
closer than with the runner-up, at the size that the regression gave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from samrl_core.diagnosis.result import HeldOutGap, NamedEffect
from samrl_core.diagnosis.selection.selection import Selection
from samrl_core.diagnosis.verdict.decision import Decision, VerdictSettings
from samrl_core.diagnosis.verdict.how_far import HowFar
from samrl_core.diagnosis.verdict.missed_motion import what_stays, why_missed, why_silent


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
        return _without_a_cause(selection, settings)
    first = named[0]
    if _shows_nowhere(selection, far, settings):
        assert far.gap is not None and far.gap.shrink is not None
        return Decision(
            "no_gap",
            (
                "recordings never fitted hold nothing beyond sensor noise and the stated tolerances",
                f"{first.name} gains {selection.chosen.log_evidence:.0f} of log evidence on the fitted ones,"
                f" and shrinks the gap on the others by {far.gap.shrink:.0%}: less than noise can pass for",
            ),
        )
    much_left = _much_left(selection, first, settings)
    denials = _denials(selection, far, settings)
    refusals = [*denials, *_no_limit(selection, first, far, settings), *alarms]
    stands = bool(much_left) and not refusals and is_dominant(selection, far, settings)
    if much_left and not stands:
        refusals = [*much_left, *refusals]
    if refusals:
        wrong = f"nearest is {first.name}, which would be wrong"
        return Decision("none_of_mine", (*refusals, wrong), contradicted=bool(denials))
    reasons = []
    if stands:
        reasons.append(what_stays(selection.unexplained, first.name, far.gap))
    tie = _tie(first, runner_ups, far, settings)
    missed = why_missed(first.name, far, settings)
    if tie is not None:
        return Decision("ambiguous", (*reasons, *missed, tie.reason), tie.names)
    if missed:
        return Decision("none_of_mine", (*reasons, *missed, f"nearest is {first.name}"))
    return Decision("effect", (*reasons, *_why_named(selection, first, runner_ups, far, settings)))


def _shows_nowhere(selection: Selection, far: HowFar, settings: VerdictSettings) -> bool:
    """Whether what was chosen on fitted recordings leaves no trace on the others, in residual or in motion.

    Noise that a regressor shares with the residual (errors in variables; Soderstrom 2007) wins some evidence,
    as does one machine of many by chance. What wins more by far may be there and not have happened again.
    """
    gap, chosen = far.gap, selection.chosen
    if gap is None or gap.shrink is None or gap.shrink >= settings.noticed or chosen is None:
        return False
    if any(h.effect.by_chance for h in chosen.hypotheses):
        return False  # what strikes by chance need not strike again
    if _shows_a_little(selection, gap, settings):
        return False
    return (
        selection.held_out_excess < settings.shown
        and selection.excess < settings.no_gap
        and not _is_sure(selection, settings)
    )


def _shows_a_little(selection: Selection, gap: HeldOutGap, settings: VerdictSettings) -> bool:
    """Whether unseen recordings show what was chosen by little: their residual, and motion does not deny it.

    Either as much as it should, within a deviation (`held_out_gains`: what is won varies by the root of twice
    what is expected); noise in a regressor comes again too, and wins half of that. Or motion shows it for
    sure, and no rival comes as close.
    """
    won, expected = selection.held_out_gain, selection.held_out_expected
    if won < settings.shown or gap.ci95 is None or gap.ci95[1] < 0.0:
        return False
    closer = gap.ci95[0] > 0.0 and (gap.margin is None or gap.margin > 0.0)
    return closer or won >= expected - (2.0 * expected) ** 0.5


def _is_sure(selection: Selection, settings: VerdictSettings) -> bool:
    """Whether fitted recordings show what was chosen beyond any chance."""
    won = 0.0 if selection.chosen is None else selection.chosen.log_evidence
    return won >= settings.clearly * selection.threshold


def _without_a_cause(selection: Selection, settings: VerdictSettings) -> Decision:
    """The verdict where no effect was chosen."""
    if only_held_out(selection, settings):
        return Decision(
            "none_of_mine",
            (
                f"held-out recordings hold {selection.held_out_excess:.0f} of log evidence beyond noise"
                " and tolerances, the fitted ones do not",
                "fit a recording of the same kind too",
            ),
            unexplained=1.0,
        )
    if selection.excess < settings.no_gap:
        return Decision(
            "no_gap",
            ("nothing beyond sensor noise and the stated tolerances was found", _not_enough(selection)),
        )
    return Decision(
        "none_of_mine",
        (
            f"the recordings hold {selection.excess:.0f} of log evidence beyond noise and tolerances",
            f"no effect of the library reaches {selection.threshold:.1f} of log evidence",
        ),
        unexplained=1.0,
    )


def _much_left(selection: Selection, first: NamedEffect, settings: VerdictSettings) -> list[str]:
    """Where too much of the gap stays unexplained; empty if nowhere."""
    out = []
    if selection.excess > settings.visible and selection.unexplained > settings.unexplained:
        out.append(
            f"{selection.unexplained:.0%} of the gap stays unexplained with {first.name}, "
            f"more than {settings.unexplained:.0%}"
        )
    left = selection.held_out_unexplained
    if _is_visible_there(selection, settings) and left > settings.held_out_unexplained:
        out.append(
            f"on held-out recordings {left:.0%} stay unexplained,"
            f" more than {settings.held_out_unexplained:.0%}"
        )
    return out


def _is_visible_there(selection: Selection, settings: VerdictSettings) -> bool:
    """Whether shares of the held-out gap say something; when chance strikes again, they do not."""
    return selection.held_out_excess > settings.visible and not _by_chance(selection)


def _by_chance(selection: Selection) -> bool:
    assert selection.chosen is not None
    return any(h.effect.by_chance for h in selection.chosen.hypotheses)


def _denials(selection: Selection, far: HowFar, settings: VerdictSettings) -> list[str]:
    """How held-out recordings contradict what was fitted; empty if they do not."""
    out = []
    if not _is_visible_there(selection, settings):
        if not _by_chance(selection) and denies(selection, settings):
            out.append(
                f"what was fitted should win {selection.held_out_expected:.0f} of log likelihood on held-out"
                f" recordings, and loses {-selection.held_out_gain:.0f}"
            )
        elif selection.held_out_remaining > selection.held_out_excess + settings.visible:
            out.append("with it, held-out recordings fit worse than without")
    if far.gap is not None and far.gap.shrink is not None and _grows(selection, far.gap, settings):
        out.append(f"with it, the gap on held-out recordings grows by {-far.gap.shrink:.0%}")
    return out


def _no_limit(
    selection: Selection, first: NamedEffect, far: HowFar, settings: VerdictSettings
) -> tuple[str, ...]:
    """Why what is named as a limit of the drive is none; empty if it may be one."""
    assert selection.chosen is not None
    limit = selection.chosen.hypotheses[0].effect.limits_motion and (
        not explains_all(selection, settings) or _moves_wrongly(far, settings)
    )
    if limit and 0.0 <= _moves(far) < settings.limits:
        return (f"{first.name} is no limit: without it the motion is hardly simulated worse",)
    return ()


@dataclass(frozen=True)
class Tie:
    """Rivals that are as probable as what is named, and why."""

    names: tuple[str, ...]
    reason: str


def _tie(
    first: NamedEffect, runner_ups: Sequence[NamedEffect], far: HowFar, settings: VerdictSettings
) -> Tie | None:
    """By probability, or as a rival brings simulated motion much closer; None if there is no tie."""
    # Where much stays unexplained many rivals share what is probable, and each has little of it.
    least = min(settings.rival, settings.share * first.probability)
    tied = tuple(r.name for r in runner_ups if r.probability > least)
    if first.probability < settings.tie and tied:
        return Tie(tied, f"{first.name} ({first.probability:.0%}) cannot be told from {', '.join(tied)} here")
    closer = _moves_closer(far, settings)
    if closer is None or closer not in {r.name for r in runner_ups}:
        return None
    assert far.gap is not None and far.gap.shrink is not None and far.gap.margin is not None
    return Tie(
        (closer,),
        f"{first.name} explains more of the torque, but {closer} brings simulated motion closer:"
        f" by {far.gap.shrink - far.gap.margin:.0%} on held-out recordings, not by {far.gap.shrink:.0%}",
    )


def _why_named(
    selection: Selection,
    first: NamedEffect,
    runner_ups: Sequence[NamedEffect],
    far: HowFar,
    settings: VerdictSettings,
) -> list[str]:
    """What speaks for the effect that is named."""
    out = [f"{first.name} gains {first.gain:.0f} of log evidence; {selection.threshold:.0f} are needed"]
    if runner_ups:
        lead = first.gain - runner_ups[0].gain
        told = f"{lead:.0f} less"
        if lead < 0:
            told = f"{-lead:.0f} more of the torque; simulated motion or wider tolerances put it behind"
        out.append(f"the next best, {runner_ups[0].name}, explains {told}")
    if far.gap is not None and far.gap.shrink is not None:
        out.append(why_silent(first.name, far, settings) or how_it_moves(far.gap))
    return out


def how_it_moves(gap: HeldOutGap) -> str:
    """What held-out recordings say of the effect that is named; that it does not help there is said so."""
    assert gap.shrink is not None
    if round(100 * gap.shrink) > 0:
        return f"the gap on held-out recordings shrinks by {gap.shrink:.0%}"
    return (
        "the gap on held-out recordings does not shrink: its size there is not the one found,"
        " or something else is off as well"
    )


def hidden_in_noise(named: NamedEffect) -> Decision:
    """The verdict where nothing stands out: no joint, channel and phase, the best effect's own part included.

    Evidence adds up over many samples; where noise is coarser than it is stated to be white, what adds up is
    the shape of the noise. A gap that can be shown nowhere is none.
    """
    return Decision(
        "no_gap",
        (
            "no joint, channel and phase stands out of noise and the stated tolerances",
            f"the best effect, {named.name}, gains {named.gain:.0f} of log evidence, but what it does stays"
            " below the noise everywhere",
        ),
    )


def unconfirmed(
    refused: Decision, selection: Selection, named: NamedEffect, settings: VerdictSettings
) -> Decision | None:
    """The verdict where only an effect shows a gap, and held-out recordings contradict it; else None.

    A gap that no effect explains must be seen without one: in more than noise and tolerances leave. Where
    nothing at all exceeds those, and no effect wins more than twice what it needs, a refused one shows none
    either: among hundreds that are tried one is now and then just believed.
    """
    most = max(selection.excess, selection.held_out_excess)
    little = most < settings.shown and 0.0 < selection.most < settings.twice * selection.threshold
    # So much evidence is in the recordings, whoever is wrong about its cause: tolerances do not explain it.
    # Where nothing at all exceeds noise, it is what laws that undo each other find within noise.
    clear = named.gain > settings.clearly * selection.threshold and most >= settings.shown
    if little and not refused.contradicted:
        return Decision(
            "no_gap",
            (
                f"the best effect gains {selection.most:.1f} of log evidence,"
                f" {selection.threshold:.1f} are needed, and {named.name}, {named.gain:.1f}, is refused",
                "without them nothing beyond sensor noise and the stated tolerances was found",
            ),
        )
    if not refused.contradicted or most >= settings.no_gap or clear:
        return None
    return Decision(
        "no_gap",
        (
            f"what {named.name} explains of the fitted recordings, {named.gain:.0f} of log evidence, is"
            " contradicted by the held-out ones",
            "without it nothing beyond sensor noise and the stated tolerances was found",
        ),
    )


def is_dominant(selection: Selection, far: HowFar, settings: VerdictSettings) -> bool:
    """Whether simulation on held-out recordings says the same as the regression, clearly."""
    gap = far.gap
    if gap is None or gap.shrink is None or gap.ci95 is None or far.motion is None or far.size is None:
        return False
    most = max(selection.unexplained, selection.held_out_unexplained)
    least = settings.half if most > settings.hardly else settings.dominant
    return (
        most < 1.0
        and max(gap.shrink, far.motion) >= least
        and min(gap.shrink, far.motion) > 0.0
        and gap.ci95[0] >= settings.surely
        and (gap.margin is None or gap.margin >= settings.margin or _by_a_twin(selection, gap))
        and settings.sizes[0] <= far.size <= settings.sizes[1]
    )


def explains_all(selection: Selection, settings: VerdictSettings) -> bool:
    """Whether a clear gap is explained to the last: what fits any torque a little does not do that."""
    assert selection.chosen is not None
    clear = selection.chosen.log_evidence > settings.clearly * selection.threshold
    most = max(selection.unexplained, selection.held_out_unexplained)
    return clear and most < settings.all


def denies(selection: Selection, settings: VerdictSettings) -> bool:
    """Whether held-out recordings would show what was fitted, and show nothing of it: a fit to noise."""
    return selection.held_out_expected > settings.shown and selection.held_out_gain < 0.0


def _grows(selection: Selection, gap: HeldOutGap, settings: VerdictSettings) -> bool:
    """Whether held-out recordings come less close with what is named: much, or little and for sure.

    What is sure on fitted recordings is not denied by a little where the gap lies within tolerances, nor by
    less than would be noticed.
    """
    if gap.shrink is not None and gap.shrink < settings.worse:
        return True
    if gap.ci95 is None or gap.ci95[1] >= 0.0:
        return False
    hardly = gap.nominal < 1.0 or (gap.shrink is not None and gap.shrink > -settings.noticed)
    return not (hardly and _is_sure(selection, settings))


def _by_a_twin(selection: Selection, gap: HeldOutGap) -> bool:
    """Whether the runner-up is one that these recordings may not tell apart."""
    assert selection.chosen is not None
    family = (gap.runner_up_effect or "").partition("@")[0]
    return family in selection.chosen.hypotheses[0].effect.confounded_with


def _moves(far: HowFar) -> float:
    """Shrink of the simulated gap; -1 where nothing was simulated."""
    if far.gap is None or far.gap.shrink is None or far.motion is None:
        return -1.0
    return max(0.0, far.gap.shrink, far.motion)


def _moves_wrongly(far: HowFar, settings: VerdictSettings) -> bool:
    """Whether held-out motion is far from the nominal one: then a cause must show there."""
    return far.gap is not None and far.motion is not None and far.gap.nominal > settings.seen


def _moves_closer(far: HowFar, settings: VerdictSettings) -> str | None:
    """The runner-up whose simulation comes much closer to a clear gap of motion than what is named."""
    if not _moves_wrongly(far, settings):
        return None
    assert far.gap is not None
    if far.gap.margin is None or far.gap.margin > -settings.closer:
        return None
    return far.gap.runner_up_effect


def only_held_out(selection: Selection, settings: VerdictSettings) -> bool:
    """Whether nothing is seen where it could be fitted, but much where it was not."""
    quiet = selection.chosen is None and selection.excess < settings.no_gap
    return quiet and selection.held_out_excess > settings.no_gap


def _not_enough(selection: Selection) -> str:
    best = selection.singles[0].log_evidence if selection.singles else 0.0
    if best >= selection.threshold:
        return (
            f"the best effect, {selection.singles[0].hypotheses[0].name}, gains {best:.1f} of log evidence"
            " with the tolerances as stated, and too little if they are twice as wide"
        )
    return f"the best effect gains {best:.1f} of log evidence, {selection.threshold:.1f} are needed"
