"""A verdict on one candidate after another, until one is not refused.

The first is the set that the search preferred. If only a further member of it is contradicted, the set
without that member is tried; if the whole is refused, the set that grows from the next candidate for the
first effect. What comes later must bring held-out recordings as close as the refused one did, and what was
refused is no rival of it. Where all are refused, the first is the nearest.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import HeldOutGap, NamedEffect
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, on_bound
from samrl_core.diagnosis.selection.selection import Selection, with_chosen, without_member
from samrl_core.diagnosis.selection.twins import find_twins
from samrl_core.diagnosis.verdict import rules
from samrl_core.diagnosis.verdict.confidence import estimates, probabilities
from samrl_core.diagnosis.verdict.confirmation import not_confirmed, nothing_confirms
from samrl_core.diagnosis.verdict.encompassing import find_told_apart, why_tied
from samrl_core.diagnosis.verdict.foretelling import find_as_foretelling, is_denied_there
from samrl_core.diagnosis.verdict.foretold_motion import foretell_motion
from samrl_core.diagnosis.verdict.further_members import find_superfluous
from samrl_core.diagnosis.verdict.how_far import HowFar, how_far
from samrl_core.diagnosis.verdict.invariance import invariance_alarms
from samrl_core.diagnosis.verdict.missed_motion import evidence_missed, is_missed, may_not_shrink
from samrl_core.diagnosis.verdict.open_forms import keep_forms_open

RUNNER_UPS = 5
ATTEMPTS = 5  # sets that are judged at most
LATER_LEAVES = 0.25  # of the torque, at most, unless it shrinks the held-out gap by
LATER_SHRINKS = 0.5  # where a known effect is the second choice, an unknown one is more probable
ABOUT = 0.05  # difference of two shrinks that says nothing
OF_THE_REST = 0.5  # of what a refused set left, at most, that one with a member more may leave

# Known causes that are no effect: evidence, what was chosen, what an effect needs [nat] -> words.
Doubts = Callable[[Evidence, Fit | None, float], list[str]]


@dataclass(frozen=True, eq=False)
class Judged:
    """A set, what is said of it, and the verdict."""

    selection: Selection
    named: tuple[NamedEffect, ...]
    runner_ups: tuple[NamedEffect, ...]
    alarms: tuple[str, ...]
    far: HowFar
    outcome: rules.Decision


@dataclass(frozen=True, eq=False)
class Judge:
    """What sets of effects are judged by: recordings to fit and held out, limits, and known causes beside."""

    likelihood: Likelihood
    held: Likelihood
    settings: rules.VerdictSettings
    simulate: bool
    seed: int
    progress: Callable[[str], None]
    doubts: Doubts = lambda evidence, chosen, least: []

    def judge_first(self, selection: Selection) -> Judged:
        """The first set that is not refused, or else the nearest."""
        nearest: Judged | None = None
        attempts = _attempts(self.likelihood, self.held, selection)
        contradicted: tuple[int, ...] = ()
        refused: set[str] = set()
        for _ in range(ATTEMPTS):
            try:
                tried = attempts.send(contradicted if nearest is not None else None)
            except StopIteration:
                break
            tried = replace(tried, denied=tried.denied | refused)
            one, contradicted = self.judge_set(tried)
            if (plainer := _plainer(self.likelihood, self.held, one)) is not None:
                simple, denied = self.judge_set(plainer)
                if simple.outcome.verdict != "none_of_mine" and comes_as_close(simple.far.gap, one.far.gap):
                    one, contradicted = simple, denied
            without = self._without_superfluous(one)
            if without is not None:
                one, contradicted = without, ()
            if one.outcome.verdict != "none_of_mine" and (nearest is None or _replaces(one, nearest)):
                return one
            nearest = nearest or one
            if one.named and (contradicted == (0,) or len(one.named) == 1):
                refused.add(one.named[0].name)
        assert nearest is not None
        if nearest.selection.chosen is not None and nearest.outcome.verdict == "none_of_mine":
            quiet = rules.unconfirmed(nearest.outcome, nearest.selection, nearest.named[0], self.settings)
            evidence = Evidence(self.likelihood, nearest.selection.correlation_time)
            if quiet is not None and not self.doubts(evidence, None, selection.threshold):
                return replace(nearest, outcome=quiet)
        return nearest

    def judge_set(self, selection: Selection) -> tuple[Judged, tuple[int, ...]]:
        """A set with its verdict, and the indices of members that an alarm contradicts."""
        rng = np.random.default_rng(self.seed)
        likelihood, held = self.likelihood, self.held
        evidence = Evidence(likelihood, selection.correlation_time)
        selection, open_forms = keep_forms_open(likelihood, held, selection)
        chosen = selection.chosen
        named: tuple[NamedEffect, ...] = ()
        runner_ups: tuple[NamedEffect, ...] = ()
        alarms: list[str] = []
        if chosen is not None:
            self.progress("how sure")
            twins, rivals, denied = _rivals(evidence, held, selection, chosen)
            tied = range(1, len(twins) + 1)
            apart = find_told_apart(likelihood, held, selection)
            told = [i for i, r in enumerate(rivals, 1) if i not in tied and any(r is a for a in apart)]
            weighed = partial(probabilities, [chosen, *rivals], tied=tied, denied=denied, told=told)
            p = weighed(selection.remaining)
            named = tuple(
                _named(evidence, chosen, i, float(p[0]), "primary" if i == 0 else "secondary", rng)
                for i in range(len(chosen.hypotheses))
            )
            runner_ups = tuple(
                _named(evidence, f, 0, float(q), "runner_up", rng)
                for f, q in zip(rivals[:RUNNER_UPS], p[1:], strict=False)
            )
            whole = Likelihood([*likelihood.trials, *held.trials])
            alarms += invariance_alarms(whole, chosen, selection.correlation_time)
            for h in chosen.hypotheses:
                alarms += [f"{h.name}: {name} ended on the bound of its search" for name in on_bound(h)]
        doubted = self.doubts(evidence, chosen, selection.threshold)
        alarms = [*doubted, *alarms]  # what was seen says more than what an effect of the library cannot do
        self.progress("how far")
        far = how_far(held, selection, self.simulate, rng, self.progress, likelihood)
        alarms += list(far.alarms)
        outcome = rules.decide(selection, named, runner_ups, alarms, far, self.settings)
        named_at_all = outcome.verdict in ("effect", "ambiguous")
        if chosen is not None and named_at_all and may_not_shrink(chosen, far, self.settings):
            far = replace(far, foretold=foretell_motion(held.trials, chosen, rng))
            if is_missed(far, self.settings):
                p = weighed(max(selection.remaining, evidence_missed(chosen, far)))
                named, runner_ups = _with_probabilities(named, runner_ups, p)
            outcome = rules.decide(selection, named, runner_ups, alarms, far, self.settings)
        if chosen is None and doubted:
            outcome = rules.Decision("none_of_mine", tuple(doubted), unexplained=1.0)
        if outcome.verdict == "effect" and nothing_confirms(likelihood, selection, far, self.settings):
            outcome = not_confirmed(selection, named[0], runner_ups)
            named, runner_ups = _as_open(named, runner_ups, outcome.tied)
        if outcome.verdict in ("effect", "ambiguous"):
            why = [why_tied(likelihood, held, selection, rival) for rival in outcome.tied[:1]]
            outcome = replace(outcome, reasons=(*outcome.reasons, *filter(None, why), *open_forms))
        contradicted = tuple(
            i for i, n in enumerate(named) if any(a.startswith((f"{n.name}:", f"{n.name} ")) for a in alarms)
        )
        if outcome.contradicted and not contradicted and len(named) > 1:
            contradicted = (len(named) - 1,)  # held-out recordings deny the set, and say not which of it
        return Judged(selection, named, runner_ups, tuple(alarms), far, outcome), contradicted

    def _without_superfluous(self, one: Judged) -> Judged | None:
        """The set without further members for which nothing certain speaks; None where all stand or it falls.

        What stood beside one of them need not stand without it: what is contradicted then goes too.
        """
        if one.outcome.verdict == "none_of_mine" or len(one.named) < 2:
            return None
        less, leave = one, find_superfluous(one.selection, one.named, one.far)[-1:]
        while leave:
            fewer = without_member(self.likelihood, self.held, less.selection, leave)
            if fewer.chosen is None or not np.isfinite(fewer.chosen.log_evidence):
                return None
            less, denied = self.judge_set(fewer)
            if less.outcome.verdict == "none_of_mine":
                leave = tuple(k for k in denied if k > 0)
            else:
                leave = find_superfluous(less.selection, less.named, less.far)[-1:]
        return None if less is one or less.outcome.verdict == "none_of_mine" else less


def _attempts(
    likelihood: Likelihood, held: Likelihood, selection: Selection
) -> Generator[Selection, tuple[int, ...] | None, None]:
    """Sets in the order in which they are judged; is sent the members of the last that were contradicted."""
    waiting = list(selection.contenders)
    tried = selection
    while True:
        contradicted = (yield tried) or ()
        # A first effect whose size was found beside a wrong one gets a verdict without that.
        if tried.chosen is not None and (further := tuple(i for i in contradicted if i > 0)):
            fewer = without_member(likelihood, held, tried, further)
            # What was possible only beside them is no set alone.
            if fewer.chosen is not None and np.isfinite(fewer.chosen.log_evidence):
                tried = fewer
                continue
        if not waiting or selection.again is None:
            return
        tried = selection.again(waiting.pop(0))


def _plainer(likelihood: Likelihood, held: Likelihood, one: Judged) -> Selection | None:
    """The set with the family that all tied ones contain: with or without their further term, it is there."""
    selection, chosen = one.selection, one.selection.chosen
    if one.outcome.verdict != "ambiguous" or chosen is None:
        return None
    tied = [f for f in selection.rivals if f.hypotheses[0].name in one.outcome.tied]
    group = [chosen, *tied]
    for fit in group:
        first = fit.hypotheses[0]
        others = [f.hypotheses[0] for f in group if f is not fit]
        if all(h.place == first.place and first.effect.family in h.effect.contains for h in others):
            rest = tuple(f for f in (chosen, *selection.rivals) if f not in group)
            return with_chosen(likelihood, held, selection, fit, rest)
    return None


def comes_as_close(one: HeldOutGap | None, other: HeldOutGap | None) -> bool:
    """Whether held-out recordings come about as close with one set as with another, as far as they tell.

    A friction that depends on the direction contains Coulomb's. Where it brings them much closer, its further
    term is there.
    """
    if one is None or other is None or one.shrink is None or other.shrink is None:
        return True
    return one.shrink >= other.shrink - ABOUT


def _replaces(one: Judged, nearest: Judged) -> bool:
    """Whether a set may be named although another was refused: held-out recordings come as close with it.

    With the refused effect as a further member it would be the refused set in another order, unless what is
    new in it explains most of what that left. A formula that contains the refused one is the same cause with
    the term for which that was refused: what the wrong size did to the motion is no measure of it.
    """
    first = nearest.named[0].name
    if _contains(one.selection, nearest.selection):
        return True
    if (
        one.named[0].name != first
        and first in {n.name for n in one.named}
        and not _explains_the_rest(one, nearest)
    ):
        return False
    a, b = one.far.gap, nearest.far.gap
    if one.named[0].name != first:
        left = max(one.selection.unexplained, one.selection.held_out_unexplained)
        if left > LATER_LEAVES and (a is None or a.shrink is None or a.shrink < LATER_SHRINKS):
            return False
    if a is None or b is None or a.shrink is None or b.shrink is None:
        left, before = (j.selection.held_out_unexplained for j in (one, nearest))
        return one.named[0].name == first or left <= before + ABOUT
    return a.shrink >= b.shrink - ABOUT


def _contains(one: Selection, other: Selection) -> bool:
    """Whether the first effect of a set has the place of another set's, and a formula that contains its."""
    if one.chosen is None or other.chosen is None:
        return False
    wider, plain = one.chosen.hypotheses[0], other.chosen.hypotheses[0]
    return wider.place == plain.place and plain.effect.family in wider.effect.contains


def _explains_the_rest(one: Judged, nearest: Judged) -> bool:
    """Whether a set has a member that a refused one lacked, and leaves half as much with it, held out too.

    A slide's dry friction, refused as its size grew with the speed, was the larger part of both frictions.
    """
    if {n.name for n in one.named} <= {n.name for n in nearest.named}:
        return False
    a, b = one.selection, nearest.selection
    return (
        a.unexplained <= OF_THE_REST * b.unexplained
        and a.held_out_unexplained <= OF_THE_REST * b.held_out_unexplained
    )


def _rivals(
    evidence: Evidence, held: Likelihood, selection: Selection, chosen: Fit
) -> tuple[list[Fit], tuple[Fit, ...], list[int]]:
    """Rivals that are as probable as the chosen set; all, those in front; indices of denied ones, from 1."""
    k = selection.correlation_time
    refuted = {id(r) for r in selection.rivals[:RUNNER_UPS] if is_denied_there(held, r, k)}
    twins = [r for r in find_twins(evidence, chosen, selection.rivals) if id(r) not in refuted]
    twins += [r for r in find_as_foretelling(evidence, held, selection) if r not in twins]
    rivals = (*twins, *(r for r in selection.rivals if r not in twins)) if twins else selection.rivals
    denied = [
        i
        for i, r in enumerate(rivals, 1)
        if i > len(twins) and (id(r) in refuted or _is_denied(selection, chosen, r))
    ]
    return twins, rivals, denied


def _as_open(
    named: tuple[NamedEffect, ...], runner_ups: tuple[NamedEffect, ...], tied: Sequence[str]
) -> tuple[tuple[NamedEffect, ...], tuple[NamedEffect, ...]]:
    """What is named and what stays open beside it, one as probable as the other."""
    even = 1.0 / (1 + len(tied))
    others = (replace(r, probability=even if r.name in tied else 0.0) for r in runner_ups)
    return tuple(replace(n, probability=even) for n in named), tuple(others)


def _with_probabilities(
    named: tuple[NamedEffect, ...], runner_ups: tuple[NamedEffect, ...], p: np.ndarray
) -> tuple[tuple[NamedEffect, ...], tuple[NamedEffect, ...]]:
    """What is named and its rivals with probabilities (1 + R,)."""
    others = (replace(r, probability=float(q)) for r, q in zip(runner_ups, p[1:], strict=False))
    return tuple(replace(n, probability=float(p[0])) for n in named), tuple(others)


def _is_denied(selection: Selection, chosen: Fit, rival: Fit) -> bool:
    """Whether a rival is no candidate: simulated motion contradicts it, or a bound of its search does.

    A shape on the bound of its search is another formula's; that says nothing against a chosen one there too.
    """
    first = rival.hypotheses[0]
    if first.name in selection.denied:
        return True
    return bool(on_bound(first)) and not any(on_bound(h) for h in chosen.hypotheses)


def _named(
    evidence: Evidence, fit: Fit, index: int, probability: float, role: str, rng: np.random.Generator
) -> NamedEffect:
    h = fit.hypotheses[index]
    return NamedEffect(
        h.effect.family, h.place, probability, estimates(evidence, fit, index, rng), fit.log_evidence,
        h.form.name, role,
    )  # fmt: skip
