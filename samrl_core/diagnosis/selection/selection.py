"""Which effects: forward selection with swaps, scored by evidence and by the remainder on held-out
recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.bounded_tolerances import evidence_beyond
from samrl_core.diagnosis.selection.cancellation import undo_each_other
from samrl_core.diagnosis.selection.contenders import NEXT, Contender, contend, denied_by_motion
from samrl_core.diagnosis.selection.form_that_moves import with_form_that_moves
from samrl_core.diagnosis.selection.further_effect import is_worth
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis, hypothesis, on_bound
from samrl_core.diagnosis.selection.null_simulations import simulate_null_evidence, threshold
from samrl_core.diagnosis.selection.on_held_out import held_out_gains, held_out_remainder
from samrl_core.diagnosis.selection.onset_search import find_later, find_onset
from samrl_core.diagnosis.selection.other_starts import STARTS, in_plain_terms, simplest
from samrl_core.diagnosis.selection.search import (
    best_singles,
    find_extensions,
    find_rivals,
    swap_members,
)
from samrl_core.diagnosis.selection.settings import SelectionSettings

MOST_EFFECTS = 3
CLEARLY_MORE = 1.5  # times what the first member adds to the others
SURELY = 8.0  # times the threshold: beyond, no width of tolerances explains it
WIDE = 2.0  # times the stated tolerances: many a machine is so far off, and that alone is no effect
TRIED_WIDE = 6  # effects, at most, of which one may be believed with wider tolerances
SEEN_THERE = 0.1  # of the fitted excess: held-out recordings with less hardly show the effect


@dataclass(frozen=True, eq=False)
class Selection:
    """The chosen set and its rivals, in the metric of the likelihood."""

    chosen: Fit | None
    singles: tuple[Fit, ...]  # best single fit of each family and place, best first
    rivals: tuple[Fit, ...]  # the chosen set with its first effect exchanged, best first; chosen excluded
    threshold: float
    excess: float  # log likelihood that a perfect explanation would win [nat], before
    remaining: float  # after
    held_out_excess: float
    held_out_remaining: float
    correlation_time: float
    held_out_gain: float = 0.0  # log likelihood [nat] that held-out recordings win by what was fitted
    held_out_expected: float = 0.0  # that they would win if it were exactly so
    denied: frozenset[str] = frozenset()  # other first effects, which simulated motion contradicts
    contenders: tuple[Fit, ...] = ()  # further first effects, in the order in which they are tried
    again: Callable[[Fit], Selection] | None = None  # the set that grows from another first effect
    most: float = 0.0  # largest log evidence of any single effect, be it refused for the motion
    pool: tuple[Hypothesis, ...] = ()  # every effect at every place, form and grid shape that can be seen

    @property
    def unexplained(self) -> float:
        """Share of all there was that the chosen set leaves, 0..1.

        A perfect explanation wins at least what this one does. Where tolerances could swallow most of an
        effect, the excess beyond them is less than that. What another wins more is there to be explained,
        though it be no cause.
        """
        won = 0.0 if self.chosen is None else self.chosen.log_evidence
        left = self.remaining if self.chosen is None else max(self.remaining, self.most - won)
        return float(np.clip(left / max(self.excess, won, self.most, 1e-9), 0.0, 1.0))

    @property
    def held_out_unexplained(self) -> float:
        """The same on held-out recordings; may exceed 1.

        Where those hardly show the effect, what is left there is little beside what it explained elsewhere.
        """
        whole = max(self.held_out_excess, self.held_out_gain, SEEN_THERE * self.excess, 1e-9)
        return float(max(0.0, self.held_out_remaining / whole))


def select(
    likelihood: Likelihood,
    held_out: Likelihood,
    effects: Sequence[Effect],
    settings: SelectionSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> Selection:
    """Screen everything, then build the smallest set that explains the gap."""
    evidence = Evidence(likelihood, max(2.0, likelihood.correlation_time(likelihood.y)) ** 0.5)
    progress("screening effects")
    pool = evidence.screen(effects)
    least = settings.threshold
    if settings.chance:
        least = min(least, needed_evidence(len({h.name for h in pool}), settings.chance))
    if settings.null_simulations:
        found = simulate_null_evidence(
            likelihood.trials, effects, settings.null_simulations, 0, settings.cache, progress
        )
        if found is not None and len(found) > 4:
            least = threshold(found, settings.threshold)
    progress("refining")
    singles = best_singles(evidence, pool, everywhere=False)
    # The correlation that remains under the best explanation is the one that counts.
    if singles and singles[0].log_evidence > least:
        left = evidence.remainder(singles[0])
        evidence.correlation_time = max(2.0, min(likelihood.correlation_time(left), 25.0))
    singles = best_singles(evidence, pool)
    k = evidence.correlation_time
    excess, held_excess = likelihood.deficit(likelihood.y, k), held_out.deficit(held_out.y, k)
    singles = _standing_first(evidence, singles, least, settings)
    if not singles or singles[0].log_evidence < least or not _stands_wide(evidence, singles[0], settings):
        # Nothing explains it: then all that lasts counts as one, as in any residual of unknown cause.
        k = max(2.0, min(likelihood.correlation_time(likelihood.y), 25.0))
        excess, held_excess = likelihood.deficit(likelihood.y, k), held_out.deficit(held_out.y, k)
        return Selection(
            None, tuple(singles), (), least, excess, excess, held_excess, held_excess,
            evidence.correlation_time, pool=tuple(pool),
        )  # fmt: skip
    progress("weighing candidates")
    contenders = [Contender(singles[0], 1.0)]
    if settings.simulate:
        contenders = with_form_that_moves(evidence, pool, contend(evidence, singles, excess, least), excess)
    firsts = [c.fit for c in contenders]
    chosen = firsts[0]
    most = max(f.log_evidence for f in singles)
    singles = [chosen, *(f for f in singles if f.hypotheses[0].name != chosen.hypotheses[0].name)]
    progress("looking for an onset")
    left = likelihood.deficit(evidence.remainder(chosen), k) / max(excess, chosen.log_evidence, 1e-9)
    begun = find_onset(evidence, pool, singles, excess) if left > settings.onset_remainder else []
    # Also more than what the motion put behind another: that may be the same effect, there all along.
    if begun and max(f.log_evidence for f in begun) > most + settings.second_threshold:
        firsts = [*begun, *firsts]

    def grown(first: Fit) -> Selection:
        found = _grow(evidence, held_out, pool, first, singles, settings, progress)
        others = tuple(f for f in firsts if f is not first)
        mine = sorted(contenders, key=lambda c: c.fit is not first)
        denied = denied_by_motion(mine) if mine[0].fit is first else frozenset()
        return replace(
            found,
            threshold=least,
            excess=excess,
            held_out_excess=held_excess,
            denied=denied,
            contenders=others,
            again=grown,
            most=most,
            pool=tuple(pool),
        )

    found = grown(firsts[0])
    if found.unexplained < settings.onset_remainder:
        return found  # nothing is left for another set
    others = [grown(first) for first in firsts[1 : 1 + STARTS]]
    return simplest(found, others, settings.second_threshold)


def needed_evidence(candidates: int, chance: float) -> float:
    """Log evidence [nat] that the best of so many candidates exceeds by chance at most.

    Evidence is a ratio of two likelihoods: where nothing is beyond tolerance its expectation is one, so it
    exceeds e^t with a chance of at most e^-t (Markov's inequality), and one of n candidates with n e^-t. That
    holds as far as noise and tolerances are as stated, and asks for no null simulation.
    """
    return float(np.log(max(candidates, 1) / chance))


def _standing_first(
    evidence: Evidence, singles: list[Fit], least: float, settings: SelectionSettings
) -> list[Fit]:
    """The same; if wider tolerances swallow the best, with the best one in front that they do not swallow.

    Only one with nearly its evidence: else the gap is mostly the swallowed one's.
    """
    for k, fit in enumerate(singles[:TRIED_WIDE]):
        if fit.log_evidence < max(least, NEXT * singles[0].log_evidence):
            break
        if _stands_wide(evidence, fit, settings):
            return [fit, *singles[:k], *singles[k + 1 :]]
    return singles


def _stands_wide(evidence: Evidence, fit: Fit, settings: SelectionSettings) -> bool:
    """Whether an effect of little evidence is believed with wider tolerances too."""
    if fit.log_evidence > SURELY * settings.threshold or evidence.likelihood.exact:
        return True
    wide = Evidence(Likelihood(evidence.likelihood.trials, WIDE), evidence.correlation_time)
    made = [hypothesis(wide.likelihood, h.effect, h.form, h.shape) for h in fit.hypotheses]
    there = [replace(m, tried=h.tried) for m, h in zip(made, fit.hypotheses, strict=True) if m is not None]
    if not there:
        return False
    if wide.fit(there).log_evidence >= settings.wide_threshold:
        return True
    beyond = evidence_beyond(evidence, fit, WIDE)
    return beyond is not None and beyond >= settings.wide_threshold


def _grow(
    evidence: Evidence,
    held_out: Likelihood,
    pool: Sequence[Hypothesis],
    first: Fit,
    singles: Sequence[Fit],
    settings: SelectionSettings,
    progress: Callable[[str], None],
) -> Selection:
    """The set that begins with one effect, its rivals and what both leave."""
    chosen, k, likelihood = first, evidence.correlation_time, evidence.likelihood
    name = first.hypotheses[0].name
    # What was put first for the motion that it explains is not exchanged for torque that it does not.
    kept = max(f.log_evidence for f in singles) > first.log_evidence
    singles = [first, *(f for f in singles if f.hypotheses[0].name != name)]
    for _ in range(MOST_EFFECTS - 1):
        progress(f"looking for effect {len(chosen.hypotheses) + 1}")
        # The best addition may only mend the first effect's formula; then a weaker one elsewhere may be real.
        candidates = _with_later(evidence, pool, chosen, find_extensions(evidence, pool, chosen), settings)
        inside = (w for w in candidates if not on_bound(w.hypotheses[-1]))
        held_left = held_out_remainder(held_out, chosen)
        worth = (w for w in inside if is_worth(evidence, held_out, chosen, held_left, w, settings))
        if (wider := next(worth, None)) is None:
            break
        chosen = swap_members(evidence, pool, wider, 1 if kept else 0)
    chosen = _greatest_first(evidence, in_plain_terms(evidence, pool, chosen), kept)
    rivals = find_rivals(evidence, pool, chosen, singles)
    beaten = bool(rivals) and rivals[0].log_evidence > chosen.log_evidence
    beaten = beaten and not on_bound(rivals[0].hypotheses[0]) and not undo_each_other(evidence, rivals[0])
    if len(chosen.hypotheses) > 1 and beaten and not kept:
        better, rivals = rivals[0], [chosen, *rivals[1:]]
        chosen = better
    remaining = likelihood.deficit(evidence.remainder(chosen), k)
    held_remaining = held_out.deficit(held_out_remainder(held_out, chosen), k)
    won = held_out_gains(held_out, chosen, k)
    return Selection(chosen, tuple(singles), tuple(rivals), 0.0, 0.0, remaining, 0.0, held_remaining, k, *won)


def _with_later(
    evidence: Evidence,
    pool: Sequence[Hypothesis],
    chosen: Fit,
    steady: list[Fit],
    settings: SelectionSettings,
) -> list[Fit]:
    """Sets with one effect more; one that begins within the recordings in front, where it explains more.

    As with a first effect it is looked for only where much is left, and must have more evidence than any that
    was there all along, clearly: a formula that is nearly right wins a little by not acting at the beginning.
    """
    k, likelihood = evidence.correlation_time, evidence.likelihood
    excess = max(likelihood.deficit(likelihood.y, k), chosen.log_evidence)
    if likelihood.deficit(evidence.remainder(chosen), k) < settings.onset_remainder * excess:
        return steady
    begun = find_later(evidence, pool, chosen, steady, excess)
    if not begun:
        return steady
    later = max(f.log_evidence for f in begun) - chosen.log_evidence
    throughout = max((f.log_evidence for f in steady), default=chosen.log_evidence) - chosen.log_evidence
    clearly = later > throughout + settings.second_threshold
    clearly = clearly and throughout < settings.throughout_share * later
    return [*begun, *steady] if clearly else steady


def _greatest_first(evidence: Evidence, fit: Fit, keep_first: bool) -> Fit:
    """The set with the member in front that adds most to the others, where it clearly does, and elsewhere.

    At one place two formulas share what they explain: there the one that was best alone stays in front.
    """
    count = len(fit.hypotheses)
    if count < 2 or keep_first:
        return fit
    adds = [
        fit.log_evidence - evidence.fit([h for k, h in enumerate(fit.hypotheses) if k != i]).log_evidence
        for i in range(count)
    ]
    most = int(np.argmax(adds))
    same_place = fit.hypotheses[most].place == fit.hypotheses[0].place
    if most == 0 or same_place or adds[most] < CLEARLY_MORE * adds[0]:
        return fit
    order = [most, *(i for i in range(count) if i != most)]
    return evidence.fit([fit.hypotheses[i] for i in order])


def without_member(
    likelihood: Likelihood, held_out: Likelihood, selection: Selection, members: Sequence[int]
) -> Selection:
    """The set without some of its further members, fitted again."""
    assert selection.chosen is not None
    evidence = Evidence(likelihood, selection.correlation_time)

    alone = {f.hypotheses[0].name: f for f in selection.singles}

    def fewer(fit: Fit) -> Fit:
        left = evidence.fit([h for i, h in enumerate(fit.hypotheses) if i not in members])
        # A shape that was found beside what is gone need not be possible alone.
        single = alone.get(left.hypotheses[0].name, left) if len(left.hypotheses) == 1 else left
        return max(left, single, key=lambda f: f.log_evidence)

    chosen, others = fewer(selection.chosen), [fewer(f) for f in selection.rivals]
    if len(chosen.hypotheses) == 1:
        # Beside what is gone some were impossible or worth nothing that alone are rivals.
        found = {f.hypotheses[0].name for f in (chosen, *others)}
        others += [f for name, f in alone.items() if name not in found]
    rivals = tuple(sorted(others, key=lambda f: -f.log_evidence))
    return with_chosen(likelihood, held_out, selection, chosen, rivals)


def with_chosen(
    likelihood: Likelihood, held_out: Likelihood, selection: Selection, chosen: Fit, rivals: tuple[Fit, ...]
) -> Selection:
    """The selection with another set in front."""
    evidence, k = Evidence(likelihood, selection.correlation_time), selection.correlation_time
    gain, expected = held_out_gains(held_out, chosen, k)
    return replace(
        selection,
        chosen=chosen,
        held_out_gain=gain,
        held_out_expected=expected,
        rivals=rivals,
        remaining=likelihood.deficit(evidence.remainder(chosen), k),
        held_out_remaining=held_out.deficit(held_out_remainder(held_out, chosen), k),
    )
