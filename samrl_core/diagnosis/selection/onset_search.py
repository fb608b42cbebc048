"""An effect that was switched on within the recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.selection.contenders import Contender, in_order
from samrl_core.diagnosis.selection.hypothesis import ONSET, Evidence, Fit, Hypothesis, hypothesis

ONSETS = 17  # times that are tried first
CANDIDATES_FOR_ONSET = 12  # best singles that may have been switched on


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
    shortest = min(t.duration for t in evidence.likelihood.trials)
    step = 0.4 * shortest / ONSETS

    def attempt(h: Hypothesis, onset: float) -> Fit | None:
        shape = {**h.shape, ONSET: onset}
        later = hypothesis(evidence.likelihood, h.effect, h.form, shape)
        return None if later is None else evidence.fit([replace(later, tried=h.tried * ONSETS)])

    place = singles[0].hypotheses[0].place
    there = [f for f in singles[CANDIDATES_FOR_ONSET:] if f.hypotheses[0].place == place]
    tried = [f.hypotheses[0] for f in [*singles[:CANDIDATES_FOR_ONSET], *there]]
    times = np.linspace(0.1, 0.9, ONSETS) * shortest
    best = _best(attempt(h, float(onset)) for h in tried for onset in times)
    if best is None:
        return []
    best = _closest_onset(attempt, best, step)
    first = best.hypotheses[0]
    better = _best(attempt(h, first.shape[ONSET]) for h in pool if h.name == first.name)
    if better is not None and better.log_evidence > best.log_evidence:
        best = _closest_onset(attempt, evidence.refine(better, 0), step)
    best = evidence.refine(best, 0)
    first = best.hypotheses[0]
    plain = _best(
        attempt(h, first.shape[ONSET])
        for h in pool
        if h.place == first.place and h.effect.family in first.effect.contains
    )
    if plain is None:
        return [best]
    plain = evidence.refine(_closest_onset(attempt, plain, step), 0)
    whole = max(excess, best.log_evidence)
    k = evidence.correlation_time
    both = [
        Contender(f, evidence.likelihood.deficit(evidence.remainder(f), k) / whole) for f in (best, plain)
    ]
    return [c.fit for c in in_order(both)]


def _best(fits: Iterable[Fit | None]) -> Fit | None:
    return max((f for f in fits if f is not None), key=lambda f: f.log_evidence, default=None)


def _closest_onset(attempt: Callable[[Hypothesis, float], Fit | None], best: Fit, step: float) -> Fit:
    """The fit with its onset moved by steps [s], halved until they are short, as long as that helps."""
    while step > 0.02:
        h = best.hypotheses[0]
        better = _best(attempt(h, h.shape[ONSET] + d) for d in (-step, step))
        if better is not None and better.log_evidence > best.log_evidence:
            best = better
        else:
            step /= 2.0
    return best
