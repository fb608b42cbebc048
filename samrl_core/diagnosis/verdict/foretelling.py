"""Rivals that foretell recordings which were never fitted as well as what is named.

Evidence on the fitted recordings also pays for what a formula fits of their noise and of other small causes.
What one formula explains beyond another there it must foretell elsewhere too: a controller whose damping and
stiffness are off by unlike factors fits a drive with one gain better than the gain does, and foretells less.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.on_held_out import SHOWN, gains, held_out_gains, held_out_remainder
from samrl_core.diagnosis.selection.selection import Selection

MOST = 5  # rivals that are compared
# [nat] Log likelihood that the true one of two sets must be expected to win over the other: what it wins
# varies by the root of twice that, so it wins nothing in one of twenty logs.
TOLD = 5.4


def find_as_foretelling(evidence: Evidence, held_out: Likelihood, selection: Selection) -> list[Fit]:
    """Rivals with less evidence that foretell held-out recordings as well as the chosen set.

    The two foretell so differently that the difference would show there, and the chosen set wins nothing by
    it. Errors of geometry are exact, and chance does not strike twice alike: nobody is compared then.
    """
    chosen = selection.chosen
    if chosen is None or not held_out.blocks or held_out.exact:
        return []
    if any(h.effect.by_chance for h in chosen.hypotheses):
        return []
    mine = held_out_remainder(held_out, chosen)
    found = []
    for rival in _candidates(evidence, selection, chosen):
        theirs = held_out_remainder(held_out, rival)
        won, expected = gains(held_out, theirs - mine, theirs, selection.correlation_time)
        if expected > TOLD and won < 0.0:
            found.append(rival)
    return found


def is_denied_there(held_out: Likelihood, rival: Fit, correlation: float) -> bool:
    """Whether held-out recordings would show what was fitted, and show nothing of it."""
    if held_out.exact or any(h.effect.by_chance for h in rival.hypotheses):
        return False
    won, expected = held_out_gains(held_out, rival, correlation)
    return expected > SHOWN and won < 0.0


def _candidates(evidence: Evidence, selection: Selection, chosen: Fit) -> list[Fit]:
    """Rivals with less evidence than the chosen set, whose first effect would be believed there."""
    name, out = chosen.hypotheses[0].name, []
    for rival in selection.rivals:
        first, *others = rival.hypotheses
        if len(out) == MOST:
            break
        if first.name == name or not np.isfinite(rival.log_evidence) or first.effect.by_chance:
            continue
        adds = rival.log_evidence - (evidence.fit(others).log_evidence if others else 0.0)
        if rival.log_evidence < chosen.log_evidence and adds >= selection.threshold:
            out.append(rival)
    return out
