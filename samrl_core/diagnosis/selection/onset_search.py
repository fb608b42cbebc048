"""Effects that were switched on within the recordings, the first one or one more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.selection.contenders import Contender, in_order
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit, Hypothesis, hypothesis, is_there

ONSETS = 17  # times that are tried first
CANDIDATES_FOR_ONSET = 12  # best singles that may have been switched on; as many beside others


def find_onset(
    evidence: Evidence, pool: Sequence[Hypothesis], singles: Sequence[Fit], excess: float
) -> list[Fit]:
    """The best single effect that begins within the recordings, at one time after each one's start.

    With the family that it contains, in the order in which they are to be tried: a Stribeck drop that only
    mends the shape of Coulomb friction's sign, or ends on the bound of its search, is none. Empty: nothing
    begins.

    Args:
        evidence: of the fitted recordings.
        pool: all forms: the best one of what acts throughout need not be that of what begins.
        singles: best fit of each family and place, best first; not empty.
        excess: log likelihood that a perfect explanation would win.
    """
    place = singles[0].hypotheses[0].place
    there = [f for f in singles[CANDIDATES_FOR_ONSET:] if f.hypotheses[0].place == place]
    tried = [f.hypotheses[0] for f in [*singles[:CANDIDATES_FOR_ONSET], *there]]
    return _begun(evidence, pool, tried, (), excess)


def find_later(
    evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit, steady: Sequence[Fit], excess: float
) -> list[Fit]:
    """The chosen set with one more effect that begins within the recordings, in the order of `find_onset`.

    Args:
        evidence: of the fitted recordings.
        pool: all forms, likewise.
        chosen: the set so far.
        steady: the best sets with one more effect that acts throughout, one of each place and family, best
            first. What begins late is little of that, and still more than what is not there.
        excess: log likelihood that a perfect explanation would win.
    """
    more = [f.hypotheses[-1] for f in steady if f.log_evidence > chosen.log_evidence]
    return _begun(evidence, pool, more[:CANDIDATES_FOR_ONSET], chosen.hypotheses, excess)


def _begun(
    evidence: Evidence,
    pool: Sequence[Hypothesis],
    tried: Sequence[Hypothesis],
    beside: tuple[Hypothesis, ...],
    excess: float,
) -> list[Fit]:
    """The best of the effects that are tried, with an onset, `beside` others that stay as they are."""
    shortest = min(t.duration for t in evidence.likelihood.trials)
    step = 0.4 * shortest / ONSETS
    mine = len(beside)

    def attempt(h: Hypothesis, onset: float) -> Fit | None:
        shape = {**h.shape, ONSET: onset}
        later = hypothesis(evidence.likelihood, h.effect, h.form, shape)
        return None if later is None else evidence.fit([*beside, replace(later, tried=h.tried * ONSETS)])

    times = np.linspace(0.1, 0.9, ONSETS) * shortest
    best = _best(attempt(h, float(onset)) for h in tried for onset in times)
    if best is None:
        return []
    best = _closest_onset(attempt, best, step)
    found = best.hypotheses[mine]
    better = _best(attempt(h, found.shape[ONSET]) for h in pool if h.name == found.name)
    if better is not None and better.log_evidence > best.log_evidence:
        best = _closest_onset(attempt, evidence.refine(better, mine), step)
    best = evidence.refine(best, mine)
    found = best.hypotheses[mine]
    plain = _best(
        attempt(h, found.shape[ONSET])
        for h in pool
        if h.place == found.place and h.effect.family in found.effect.contains and not is_there(h, beside)
    )
    if plain is None:
        return [best]
    plain = evidence.refine(_closest_onset(attempt, plain, step), mine)
    whole = max(excess, best.log_evidence)
    k = evidence.correlation_time
    both = [
        Contender(f, evidence.likelihood.deficit(evidence.remainder(f), k) / whole) for f in (best, plain)
    ]
    return [c.fit for c in in_order(both)]


def _best(fits: Iterable[Fit | None]) -> Fit | None:
    possible = (f for f in fits if f is not None and np.isfinite(f.log_evidence))
    return max(possible, key=lambda f: f.log_evidence, default=None)


def _closest_onset(attempt: Callable[[Hypothesis, float], Fit | None], best: Fit, step: float) -> Fit:
    """The fit with the onset of its last member moved by steps [s], halved until short, while that helps."""
    while step > 0.02:
        h = best.hypotheses[-1]
        better = _best(attempt(h, h.shape[ONSET] + d) for d in (-step, step))
        if better is not None and better.log_evidence > best.log_evidence:
            best = better
        else:
            step /= 2.0
    return best
