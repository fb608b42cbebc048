"""Sets that grow from another first effect, for where one formula with many shapes hides several plain ones.

On a pendulum, friction that depends on the position comes nearest to a sum of Coulomb, viscous and
load-dependent friction. It is then the best single effect, and none of the three explains what it leaves.
Recordings that were never fitted tell the two apart: the sum predicts them, the one formula does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np

from samrl_core.diagnosis.selection.contenders import ALIKE
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis, is_there, on_bound

STARTS = 2  # further first effects that are tried
TIE = 0.02  # of the evidence, that formulas lose by not being the thing itself
ABOUT = 0.05  # of what is left on fitted recordings, likewise
CLEARLY_LESS = 0.5  # times what the first set leaves on held-out recordings


class Grown(Protocol):
    """A set that grew from one first effect, and what it leaves [nat]."""

    @property
    def chosen(self) -> Fit | None:
        """The set."""
        ...

    @property
    def remaining(self) -> float:
        """On fitted recordings."""
        ...

    @property
    def held_out_remaining(self) -> float:
        """On held-out recordings."""
        ...


G = TypeVar("G", bound=Grown)


def simplest(found: G, tried: Sequence[G], least: float) -> G:
    """Of the sets that explain more than the one found, the one with the fewest free numbers; else that one.

    One that leaves by `least` [nat] more than the best of them on held-out recordings is out.
    """
    better = [s for s in tried if explains_more(s, found, least)]
    if not better:
        return found
    lowest = min(s.held_out_remaining for s in better)
    return min((s for s in better if s.held_out_remaining < lowest + least), key=_free_numbers)


def _free_numbers(selection: Grown) -> int:
    """Amplitudes and searched shapes of the chosen set."""
    assert selection.chosen is not None
    return sum(len(h.form.amplitudes) + len(h.form.refine) for h in selection.chosen.hypotheses)


def explains_more(tried: Grown, found: Grown, least: float) -> bool:
    """Whether a larger set from another start is the better explanation.

    It must leave no more on fitted recordings, and clearly less, by at least `least` [nat], on held-out ones.
    Members must have won their places as any further effect must, so their number costs nothing more.
    """
    if tried.chosen is None or found.chosen is None:
        return False
    if len(tried.chosen.hypotheses) <= len(found.chosen.hypotheses):
        return False
    if any(on_bound(h) for h in tried.chosen.hypotheses):
        return False
    unseen = found.held_out_remaining - tried.held_out_remaining
    return (
        tried.chosen.log_evidence > (1.0 - TIE) * found.chosen.log_evidence
        and tried.remaining < (1.0 + ABOUT) * found.remaining
        and tried.held_out_remaining < CLEARLY_LESS * found.held_out_remaining
        and unseen > least
    )


def in_plain_terms(evidence: Evidence, pool: Sequence[Hypothesis], fit: Fit) -> Fit:
    """The set with each member as the family that it contains, where its further term has become nothing.

    A Stribeck drop that was best alone may vanish once another effect stands beside it.
    """
    for index, mine in enumerate(fit.hypotheses):
        if len(fit.hypotheses) == 1 or not mine.effect.contains:
            continue
        others = [h for h in fit.hypotheses if h is not mine]
        plain = [
            h
            for h in pool
            if h.place == mine.place and h.effect.family in mine.effect.contains and not is_there(h, others)
        ]
        sets = [evidence.fit([*fit.hypotheses[:index], h, *fit.hypotheses[index + 1 :]]) for h in plain]
        sets = [s for s in sets if np.isfinite(s.log_evidence)]
        if not sets:
            continue
        best = evidence.refine(max(sets, key=lambda s: s.log_evidence), index)
        if best.log_evidence > fit.log_evidence - ALIKE and not on_bound(best.hypotheses[index]):
            fit = best
    return fit
