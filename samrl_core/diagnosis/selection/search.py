"""The search among sets of effects: best singles, one effect more, exchanges, rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.diagnosis.selection.cancellation import undo_each_other
from samrl_core.diagnosis.selection.hypothesis import (
    Evidence,
    Fit,
    Hypothesis,
    all_on_bound,
    is_there,
    on_bound,
)

REFINED = 6  # rivals whose shapes are searched before they are compared
NEARLY = 0.9  # of the best evidence
SEARCHES = 5  # of a family's shapes, at most, each from where the last one ended: the grid may be far off
SHAPES_TRIED = 30  # by each of them; half as many where a family is far behind
HARDLY_MORE = 0.02  # of the evidence
ADDITIONS = 6  # further effects that are refined and scored


def best_singles(evidence: Evidence, pool: Sequence[Hypothesis], everywhere: bool = True) -> list[Fit]:
    """The best single fit of each family and place; the first few refined.

    `everywhere` refines every family at its best place: shapes far from the grid's hide one.
    """
    best: dict[str, dict[str, Fit]] = {}
    evidences: dict[str, list[float]] = {}
    for h in pool:
        fit, forms = evidence.fit([h], at_borders=True), best.setdefault(h.name, {})
        evidences.setdefault(h.name, []).append(fit.log_evidence)
        if h.form.name not in forms or fit.log_evidence > forms[h.form.name].log_evidence:
            forms[h.form.name] = fit
    best = {name: _with_shapes_as_good(forms, evidences[name]) for name, forms in best.items()}
    ranked = sorted(
        (sorted(forms.values(), key=lambda f: -f.log_evidence) for forms in best.values()),
        key=lambda forms: -forms[0].log_evidence,
    )
    ranked = [forms for forms in ranked if np.isfinite(forms[0].log_evidence)]
    top, rest, seen = [], [], set()
    for k, forms in enumerate(ranked):
        family = forms[0].hypotheses[0].effect.family
        if k < REFINED:
            top.append(_refined(evidence, forms, SHAPES_TRIED, SEARCHES if everywhere else 1))
        elif everywhere and family not in seen:
            top.append(_refined(evidence, forms, SHAPES_TRIED // 2, SEARCHES))
        else:
            rest.append(_possible(evidence, forms[0]))
        seen.add(family)
    possible = [f for f in (*top, *rest) if np.isfinite(f.log_evidence)]
    return _inside_first(sorted(possible, key=lambda f: -f.log_evidence))


def _refined(evidence: Evidence, forms: Sequence[Fit], tried: int, searches: int) -> Fit:
    """The best fit of a family at a place: its best form searched, and another that comes near on the grid.

    A grid favours the form that it happens to meet: halfway between its cut-offs a filter of first order has
    less evidence than one of second order that is not there.
    """
    first = _possible(evidence, search_shapes(evidence, forms[0], tried, searches))
    impossible = on_bound(first.hypotheses[0]) or not np.isfinite(first.log_evidence)
    if len(forms) > 1 and (impossible or _comes_near(forms[1], forms[0])):
        second = _possible(evidence, search_shapes(evidence, forms[1], tried, searches))
        first = _inside_first(sorted([first, second], key=lambda f: -f.log_evidence))[0]
    return first


def _comes_near(form: Fit, best: Fit) -> bool:
    """Whether a search of its shapes may put a form before one that is better on the grid."""
    return best.log_evidence > 0 and form.log_evidence > NEARLY * best.log_evidence


def search_shapes(
    evidence: Evidence, fit: Fit, tried: int, searches: int, hardly_more: float = HARDLY_MORE
) -> Fit:
    """The fit with its shapes searched, so many tried each time, until a search hardly finds more.

    Hardly is that share of the evidence, and 1 nat at least.
    """
    for _ in range(searches):
        before, fit = fit.log_evidence, evidence.refine(fit, 0, tried, at_borders=True)
        if fit.log_evidence - before < max(1.0, hardly_more * abs(fit.log_evidence)):
            break
    return fit


def _possible(evidence: Evidence, fit: Fit) -> Fit:
    """The fit without a border: where its search did not leave that, it is another formula's."""
    return replace(evidence.fit(fit.hypotheses), hypotheses=fit.hypotheses)


def _with_shapes_as_good(forms: dict[str, Fit], evidences: Sequence[float]) -> dict[str, Fit]:
    """The best fits of a family's forms; how many shapes do as well is the sum of their evidence ratios."""
    most = max(evidences)
    if not np.isfinite(most):
        return forms
    count = float(np.sum(np.exp(np.array(evidences) - most)))
    return {
        name: replace(fit, hypotheses=(replace(fit.hypotheses[0], as_good=count),))
        for name, fit in forms.items()
    }


def _inside_first(
    fits: list[Fit], index: int = 0, bounds: Callable[[Hypothesis], list[str]] = on_bound
) -> list[Fit]:
    """A shape on the bound of its search means another formula: one nearly as good goes first.

    `fits` come best first and differ in the member of this index; `bounds` says which shapes are there.
    """
    if not fits or not bounds(fits[0].hypotheses[index]) or fits[0].log_evidence <= 0:
        return fits
    least = NEARLY * fits[0].log_evidence
    for k, fit in enumerate(fits):
        if fit.log_evidence < least:
            break
        if not bounds(fit.hypotheses[index]):
            return [fit, *fits[k + 1 :]]
    return fits


def find_extensions(evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit) -> list[Fit]:
    """The best sets with one more effect that undoes none of the others, one for each place, best first."""
    best: dict[str, Fit] = {}
    for h in pool:
        if is_there(h, chosen.hypotheses):
            continue
        fit = evidence.fit([*chosen.hypotheses, h])
        if h.name not in best or fit.log_evidence > best[h.name].log_evidence:
            best[h.name] = fit
    ranked = [f for f in sorted(best.values(), key=lambda f: -f.log_evidence) if np.isfinite(f.log_evidence)]
    kept: list[Fit] = []
    for fit in ranked:
        # Two of a place: formulas that are close before their shapes are searched may change order.
        place = fit.hypotheses[-1].place
        if sum(k.hypotheses[-1].place == place for k in kept) < 2 and not undo_each_other(evidence, fit):
            kept.append(fit)
        if len(kept) == ADDITIONS:
            break
    refined = [evidence.refine(f, len(f.hypotheses) - 1, 20) for f in kept]
    there = [f for f in refined if not undo_each_other(evidence, f)]
    return sorted(there, key=lambda f: -f.log_evidence)


def swap_members(evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit, first: int = 0) -> Fit:
    """Exchange members for anything better: a wrong first choice is seen once the second is there (FAMoS).

    Members before `first` are exchanged for other forms of themselves only: alone, a form may have stood for
    a part of what the next member explains. The last, which was just found, stays.
    """
    for index in range(len(chosen.hypotheses) - 1):
        others = [h for i, h in enumerate(chosen.hypotheses) if i != index]
        best, mine = chosen, chosen.hypotheses[index].name
        forms: dict[tuple[str, str], Fit] = {}
        for h in pool:
            if is_there(h, others) or (index < first and h.name != mine):
                continue
            # In its place: the order says which effect is the first, and rounding must not change it.
            fit = evidence.fit([*others[:index], h, *others[index:]])
            key = h.name, h.form.name
            if key not in forms or fit.log_evidence > forms[key].log_evidence:
                forms[key] = fit
            if fit.log_evidence > best.log_evidence and not undo_each_other(evidence, fit):
                best = fit
        refined = evidence.refine(best, index)
        if best is not chosen and all_on_bound(refined.hypotheses[index]):
            # Beyond its bounds a form is another: one of the same effect that stays inside goes first.
            name, form = refined.hypotheses[index].name, refined.hypotheses[index].form.name
            more = [evidence.refine(f, index) for (n, k), f in forms.items() if n == name and k != form]
            better = [refined, *(f for f in more if f.log_evidence > chosen.log_evidence)]
            better.sort(key=lambda f: -f.log_evidence)
            refined = _inside_first(better, index, all_on_bound)[0]
        stands = best is chosen or not on_bound(refined.hypotheses[index])
        if stands and not undo_each_other(evidence, refined):
            chosen = refined
    return chosen


def find_rivals(
    evidence: Evidence, pool: Sequence[Hypothesis], chosen: Fit, singles: Sequence[Fit]
) -> list[Fit]:
    """The chosen set with its first effect exchanged for each other one."""
    if len(chosen.hypotheses) == 1:
        return [f for f in singles if f.hypotheses[0].name != chosen.hypotheses[0].name][:20]
    mine, *others = chosen.hypotheses
    best: dict[str, Fit] = {}
    # A grid may favour another form than the one whose shapes were searched.
    for h in (*pool, *(f.hypotheses[0] for f in singles)):
        if h.name == mine.name or is_there(h, others):
            continue
        fit = evidence.fit([h, *others])
        if np.isfinite(fit.log_evidence) and (
            h.name not in best or fit.log_evidence > best[h.name].log_evidence
        ):
            best[h.name] = fit
    ranked = sorted(best.values(), key=lambda f: -f.log_evidence)
    return [*(evidence.refine(f, 0) for f in ranked[:3]), *ranked[3:20]]
