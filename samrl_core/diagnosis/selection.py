"""Which effects: forward choice with swaps, judged by evidence and by what remains on held-out recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.hypothesis import ONSET, Evidence, Fit, Hypothesis, hypothesis, on_bound
from samrl_core.diagnosis.likelihood import Likelihood
from samrl_core.diagnosis.null_worlds import null_gains, threshold

REFINED = 6  # rivals whose shapes are searched before they are compared
MOST_EFFECTS = 3
SEEN_THERE = 0.1  # of the fitted excess: held-out recordings with less hardly show the effect
NEARLY = 0.9  # of the best evidence
ADDITIONS = 6  # further effects that are refined and judged
ONSETS = 17  # times that are tried first
CANDIDATES_FOR_ONSET = 12  # best singles that may have been switched on


@dataclass(frozen=True)
class SelectionSettings:
    """When an effect is believed. Figures come from calibration worlds (`samrl_core.scoring.calibrate`)."""

    threshold: float = 12.0  # log evidence that a first effect needs at least against nothing [nat]
    null_worlds: int = 0  # simulate as many without an effect, and raise the threshold to what they reach
    cache: Path | None = None  # folder that keeps those worlds' gains
    second_threshold: float = 16.0  # that each further effect needs on top
    held_out_share: float = 0.05  # of the remaining held-out excess that a further effect must remove
    local_share: float = 0.4  # of what is left where it acts, likewise, on fitted recordings
    onset_rest: float = 0.05  # share left by the best effect from which on it may have been switched on
    same_share: float = 0.12  # of all there was, where the first effects act on the same channels and joints
    local_rest: float = 0.2  # less left than this share of what there was: the first effect's formula


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

    @property
    def unexplained(self) -> float:
        """Share of the excess that the chosen set leaves, 0..1."""
        return float(np.clip(self.remaining / max(self.excess, 1e-9), 0.0, 1.0))

    @property
    def held_out_unexplained(self) -> float:
        """The same on held-out recordings; may exceed 1.

        Where those hardly show the effect, what is left there is little beside what it explained elsewhere.
        """
        whole = max(self.held_out_excess, SEEN_THERE * self.excess, 1e-9)
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
    if settings.null_worlds:
        gains = null_gains(likelihood.trials, effects, settings.null_worlds, 0, settings.cache, progress)
        if gains is not None and len(gains) > 4:
            least = threshold(gains, settings.threshold)
    progress("refining")
    singles = _best_singles(evidence, pool)
    # The correlation that remains under the best explanation is the one that counts.
    if singles and singles[0].log_evidence > least:
        left = evidence.rest(singles[0])
        evidence.correlation_time = max(2.0, min(likelihood.correlation_time(left), 25.0))
        singles = _best_singles(evidence, pool)
    k = evidence.correlation_time
    excess, held_excess = likelihood.deficit(likelihood.y, k), held_out.deficit(held_out.y, k)
    if not singles or singles[0].log_evidence < least:
        # Nothing explains it: then all that lasts counts as one, as in any residual of unknown cause.
        k = max(2.0, min(likelihood.correlation_time(likelihood.y), 25.0))
        excess, held_excess = likelihood.deficit(likelihood.y, k), held_out.deficit(held_out.y, k)
        return Selection(
            None, tuple(singles), (), least, excess, excess, held_excess, held_excess,
            evidence.correlation_time,
        )  # fmt: skip
    chosen = singles[0]
    progress("looking for an onset")
    left = likelihood.deficit(evidence.rest(chosen), k) / max(excess, 1e-9)
    if left > settings.onset_rest and (switched := _switched(evidence, singles)) is not None:
        if switched.log_evidence > chosen.log_evidence + settings.second_threshold:
            chosen = switched
            singles = [switched, *(f for f in singles if f.hypotheses[0].name != switched.hypotheses[0].name)]
    for _ in range(MOST_EFFECTS - 1):
        progress(f"looking for effect {len(chosen.hypotheses) + 1}")
        # The best addition may only mend the first effect's formula; then a weaker one elsewhere may be real.
        candidates = _extend(evidence, pool, chosen)
        inside = (w for w in candidates if not on_bound(w.hypotheses[-1]))
        worth = (w for w in inside if _worth(evidence, held_out, chosen, w, settings))
        if (wider := next(worth, None)) is None:
            break
        chosen = _swap(evidence, pool, wider)
    rivals = _rivals(evidence, pool, chosen, singles)
    if rivals and rivals[0].log_evidence > chosen.log_evidence:
        better, rivals = rivals[0], [chosen, *rivals[1:]]
        chosen = better
    remaining = likelihood.deficit(evidence.rest(chosen), k)
    held_rest = held_out_rest(held_out, chosen)
    held_remaining = held_out.deficit(held_rest, k)
    return Selection(
        chosen, tuple(singles), tuple(rivals), least, excess, remaining, held_excess,
        held_remaining, evidence.correlation_time,
    )  # fmt: skip


def held_out_rest(held_out: Likelihood, fit: Fit) -> np.ndarray:
    """Held-out residuals with the fitted effects taken out; nothing is fitted again."""
    y = held_out.y
    for h, amplitudes in zip(fit.hypotheses, fit.amplitudes, strict=True):
        there = hypothesis(held_out, h.effect, h.place, h.form, h.shape)
        if there is not None:
            y = held_out.minus(there.regressors, amplitudes, y)
    return y


def _switched(evidence: Evidence, singles: Sequence[Fit]) -> Fit | None:
    """The best single effect that begins within the recordings, at one time after each one's start."""
    shortest = min(float(t.motion.time[-1] - t.motion.time[0]) for t in evidence.likelihood.trials)
    best: Fit | None = None

    def attempt(fit: Fit, onset: float) -> Fit | None:
        h = fit.hypotheses[0]
        shape = {**h.shape, ONSET: onset}
        later = hypothesis(evidence.likelihood, h.effect, h.place, h.form, shape)
        return None if later is None else evidence.fit([replace(later, tried=h.tried * ONSETS)])

    first = singles[0].hypotheses[0].place
    there = [f for f in singles[CANDIDATES_FOR_ONSET:] if f.hypotheses[0].place == first]
    for fit in [*singles[:CANDIDATES_FOR_ONSET], *there]:
        for onset in np.linspace(0.1, 0.9, ONSETS) * shortest:
            found = attempt(fit, float(onset))
            if found is not None and (best is None or found.log_evidence > best.log_evidence):
                best = found
    if best is None:
        return None
    step = 0.4 * shortest / ONSETS
    while step > 0.02:
        onset = best.hypotheses[0].shape[ONSET]
        around = [attempt(best, onset + d) for d in (-step, step)]
        better = max((f for f in around if f is not None), key=lambda f: f.log_evidence, default=None)
        if better is not None and better.log_evidence > best.log_evidence:
            best = better
        else:
            step /= 2.0
    return evidence.refine(best, 0)


def _best_singles(evidence: Evidence, pool: Sequence[Hypothesis]) -> list[Fit]:
    """The best single fit of each family and place; the first few refined."""
    best: dict[str, Fit] = {}
    for h in pool:
        fit = evidence.fit([h])
        if h.name not in best or fit.log_evidence > best[h.name].log_evidence:
            best[h.name] = fit
    ranked = sorted(best.values(), key=lambda f: -f.log_evidence)
    ranked = [f for f in ranked if np.isfinite(f.log_evidence)]
    top = [evidence.refine(f, 0) for f in ranked[:REFINED]]
    return _inside_first(sorted([*top, *ranked[REFINED:]], key=lambda f: -f.log_evidence))


def _inside_first(fits: list[Fit]) -> list[Fit]:
    """A shape on the bound of its search means another formula: one nearly as good goes first."""
    if not fits or not on_bound(fits[0].hypotheses[0]) or fits[0].log_evidence <= 0:
        return fits
    least = NEARLY * fits[0].log_evidence
    for k, fit in enumerate(fits):
        if fit.log_evidence < least:
            break
        if not on_bound(fit.hypotheses[0]):
            return [fit, *fits[k + 1 :]]
    return fits


def _extend(evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit) -> list[Fit]:
    """The best sets with one more effect, one for each place, best first."""
    taken = {h.name for h in chosen.hypotheses}
    best: dict[str, Fit] = {}
    for h in pool:
        if h.name in taken:
            continue
        fit = evidence.fit([*chosen.hypotheses, h])
        if h.name not in best or fit.log_evidence > best[h.name].log_evidence:
            best[h.name] = fit
    ranked = [f for f in sorted(best.values(), key=lambda f: -f.log_evidence) if np.isfinite(f.log_evidence)]
    kept: list[Fit] = []
    for fit in ranked:
        # Two of a place: formulas that are close before their shapes are searched may change order.
        place = fit.hypotheses[-1].place
        if len(kept) < ADDITIONS and sum(k.hypotheses[-1].place == place for k in kept) < 2:
            kept.append(fit)
    refined = [evidence.refine(f, len(f.hypotheses) - 1, 20) for f in kept]
    return sorted(refined, key=lambda f: -f.log_evidence)


def _swap(evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit) -> Fit:
    """Exchange members for anything better: a wrong first choice is seen once the second is there (FAMoS)."""
    for index in range(len(chosen.hypotheses) - 1):
        others = [h for i, h in enumerate(chosen.hypotheses) if i != index]
        taken = {h.name for h in others}
        best = chosen
        for h in pool:
            if h.name in taken:
                continue
            # In its place: the order says which effect is the first, and rounding must not change it.
            fit = evidence.fit([*others[:index], h, *others[index:]])
            if fit.log_evidence > best.log_evidence:
                best = fit
        chosen = evidence.refine(best, index)
    return chosen


def _worth(
    evidence: Evidence,
    held_out: Likelihood,
    narrow: Fit,
    wide: Fit,
    settings: SelectionSettings,
) -> bool:
    """A further effect must be significant, matter on fitted data, and help on data that were not fitted."""
    if wide.log_evidence - narrow.log_evidence < settings.second_threshold:
        return False
    k = evidence.correlation_time
    likelihood = evidence.likelihood
    rest_narrow, rest_wide = evidence.rest(narrow), evidence.rest(wide)
    added = wide.hypotheses[-1]
    there = set(added.regressors.blocks)
    # Where it acts, the further effect must explain most of what is left, or much of what there ever was:
    # it may be small beside the first, but it must not merely mend the first one's formula.
    before = likelihood.deficit(rest_narrow, k, there)
    after = likelihood.deficit(rest_wide, k, there)
    at_all = likelihood.deficit(likelihood.y, k, there)
    # A weak effect may stay below one standard deviation per sample: then its evidence says what it explains.
    explained = max(before - after, wide.log_evidence - narrow.log_evidence)
    # One family at every joint of an arm mends nothing: it is what arms have.
    common = added.place.startswith("arm:") and getattr(added.effect, "at_every_joint", False)
    mends = before < settings.local_rest * at_all and not common
    same = {b[1:] for b in there} <= {b[1:] for h in narrow.hypotheses for b in h.regressors.blocks}
    if same and not common and explained < settings.same_share * at_all:
        return False
    share = 0.9 if mends else 0.5 * settings.local_share if common else settings.local_share
    if explained < share * before:
        return False
    held_before = held_out.deficit(held_out_rest(held_out, narrow), k, _known(held_out, there))
    held_after = held_out.deficit(held_out_rest(held_out, wide), k, _known(held_out, there))
    return held_after <= (1.0 - settings.held_out_share) * held_before


def _known(held_out: Likelihood, blocks: set[tuple[int, str, int]]) -> set[tuple[int, str, int]]:
    """The same channels and joints on held-out recordings."""
    pairs = {(channel, joint) for _, channel, joint in blocks}
    return {block for block in held_out.blocks if block[1:] in pairs}


def _rivals(evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit, singles: Sequence[Fit]) -> list[Fit]:
    """The chosen set with its first effect exchanged for each other one."""
    if len(chosen.hypotheses) == 1:
        return [f for f in singles if f.hypotheses[0].name != chosen.hypotheses[0].name][:20]
    others = list(chosen.hypotheses[1:])
    taken = {h.name for h in chosen.hypotheses}
    best: dict[str, Fit] = {}
    for h in pool:
        if h.name in taken:
            continue
        fit = evidence.fit([h, *others])
        if np.isfinite(fit.log_evidence) and (
            h.name not in best or fit.log_evidence > best[h.name].log_evidence
        ):
            best[h.name] = fit
    ranked = sorted(best.values(), key=lambda f: -f.log_evidence)
    return [*(evidence.refine(f, 0) for f in ranked[:3]), *ranked[3:20]]
