"""What simulated motion says beside a verdict: of a named effect, of what it leaves, and of no gap."""

from __future__ import annotations

from samrl_core.diagnosis.result import HeldOutGap
from samrl_core.diagnosis.selection.hypothesis import Fit
from samrl_core.diagnosis.verdict.decision import VerdictSettings
from samrl_core.diagnosis.verdict.how_far import HowFar


def may_not_shrink(chosen: Fit, far: HowFar, settings: VerdictSettings) -> bool:
    """Whether a clear gap of simulated motion may not shrink with what is named: then one asks if it should.

    What strikes by chance need not strike again.
    """
    gap = far.gap
    if gap is None or gap.ci95 is None or far.motion is None or gap.nominal <= settings.seen:
        return False
    return gap.ci95[0] < settings.noticed and not any(h.effect.by_chance for h in chosen.hypotheses)


def is_missed(far: HowFar, settings: VerdictSettings) -> bool:
    """Whether held-out motion is not what it would be, were what is named all there is."""
    return (
        far.gap is not None
        and far.foretold is not None
        and far.foretold.is_missed(far.gap, settings.dominant)
    )


def evidence_missed(chosen: Fit, far: HowFar) -> float:
    """Log evidence [nat] that the formula leaves, if it leaves the same share of torque as of motion.

    Formulas that are wrong by so much are not told apart by less.
    """
    assert far.gap is not None and far.foretold is not None
    return far.foretold.beyond(far.gap) * chosen.log_evidence


def why_missed(name: str, far: HowFar, settings: VerdictSettings) -> tuple[str, ...]:
    """What the motion lacks, in words; empty if nothing."""
    if not is_missed(far, settings):
        return ()
    assert far.gap is not None and far.gap.shrink is not None
    return (
        f"were {name} all there is, the gap on held-out recordings would mostly shrink by {far.foretold}; it"
        f" does by {far.gap.shrink:.0%}: its size is not the one found, or something else is off as well",
    )


def why_silent(name: str, far: HowFar, settings: VerdictSettings) -> str:
    """Why a gap that does not shrink says nothing of what is named; empty if it says something."""
    if far.foretold is None or far.foretold.tells(settings.dominant):
        return ""
    return (
        f"the gap on held-out recordings does not shrink for sure, nor would it were {name} all there is: by"
        f" {far.foretold} on machines within tolerances and noise, so this motion says nothing of it"
    )


def what_stays(unexplained: float, name: str, gap: HeldOutGap | None) -> str:
    """Why an effect is named that leaves much of the torque, and whether anything else need be wrong."""
    more = "there is more, and smaller"
    if gap is not None and gap.ends_within:
        more = "what it moves is within tolerance"
    return (
        f"{unexplained:.0%} of the torque residual stays unexplained: {more}; {name} is named for the motion,"
        " which it brings closer at the size found"
    )


def moves_off(gap: HeldOutGap | None, settings: VerdictSettings) -> tuple[str, ...]:
    """What a verdict of no gap leaves open where held-out motion is far from the simulated one, in words.

    Torques may agree within noise and tolerances while a loop goes elsewhere: by a term that its law lacks.
    """
    if gap is None or not gap.in_tolerances or not gap.nominal > settings.seen:
        return ()
    return (
        f"simulated, held-out motion is {gap.nominal:.1f} tolerances off, which shows in no torque: check the"
        " law, what it is told, and where each recording begins",
    )
