"""What a simulated gap that does not shrink says of the named effect, and whether it says anything."""

from __future__ import annotations

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
