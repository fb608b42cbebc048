"""The form of the first effect, where the equation's favourite does not bring simulated motion closer.

Forms of one effect differ in freedom: a payload is ten numbers of the last link, or a point on an axis. What
else is wrong beside the effect is fitted by free numbers too, if that takes torque off. A link without its
inertia did so: ten numbers had 0.30 kg, 6 % more evidence than a point of 0.50 kg, and left the shoulder's
weight to its tolerances. The elbow, which reacts to the shoulder, was simulated as far off as without a load.
The name is the same, so only simulation of the fitted recordings is asked which form is meant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.selection.contenders import NEXT, Contender, motion_left
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis, all_on_bound
from samrl_core.diagnosis.selection.search import SHAPES_TRIED, search_shapes

HARDLY_MOVES = 0.25  # of the squared gap, that a form leaves: from half of the gap on others are asked
MUCH_LESS = 0.5  # times what a form leaves, of equation or motion, that another one may leave of either
TRIED = 3  # other forms, the best ones
SEARCHES = 3  # of a form's shapes, each from where the last one ended


def with_form_that_moves(
    evidence: Evidence, pool: Sequence[Hypothesis], contenders: Sequence[Contender], excess: float
) -> list[Contender]:
    """Candidates for the first effect, the first of them in another form where that moves as was recorded.

    Another form needs `NEXT` of the evidence, and must leave half as much of equation or motion, whichever is
    more: a size that is right is right in both. Among effects what both leave is multiplied (`contend`).

    Args:
        evidence: of the fitted recordings.
        pool: every effect at every place, form and grid shape.
        contenders: not empty; each of one effect.
        excess: log likelihood [nat] that a perfect explanation would win.
    """
    first, *later = contenders
    fit, trials = first.fit, evidence.likelihood.trials
    moves = first.motion_left
    if moves is not None and moves < HARDLY_MOVES:
        return list(contenders)
    forms = _other_forms(evidence, pool, fit)
    if not forms:
        return list(contenders)
    if moves is None:
        (moves,) = motion_left(trials, [fit])
    if moves is None or moves < HARDLY_MOVES:
        return list(contenders)
    near = [f for f in (_searched(evidence, f) for f in forms) if _is_near(f, fit)]
    most = max(f.log_evidence for f in (fit, *near))

    def left(one: Fit, of_motion: float | None) -> float:
        rest = evidence.likelihood.deficit(evidence.remainder(one), evidence.correlation_time)
        of_equation = max(rest, most - one.log_evidence) / max(excess, most, 1e-9)
        return max(of_equation, 1.0 if of_motion is None else of_motion)

    limit, best = MUCH_LESS * left(fit, moves), first
    for form, share in zip(near, motion_left(trials, near), strict=True):
        if (worst := left(form, share)) < limit:
            limit, best = worst, Contender(form, worst, share)
    return [best, *later]


def _other_forms(evidence: Evidence, pool: Sequence[Hypothesis], fit: Fit) -> list[Fit]:
    """The best fits of the same effect at the same place in other forms, at shapes of the grid."""
    mine = fit.hypotheses[0]
    best: dict[str, Fit] = {}
    for h in pool:
        if h.name != mine.name or h.form.name == mine.form.name:
            continue
        tried = evidence.fit([h], at_borders=True)
        if h.form.name not in best or tried.log_evidence > best[h.form.name].log_evidence:
            best[h.form.name] = tried
    return sorted(best.values(), key=lambda f: -f.log_evidence)[:TRIED]


def _searched(evidence: Evidence, fit: Fit) -> Fit:
    """The fit with its shape searched; impossible where that did not leave the border of what is possible."""
    return evidence.fit(search_shapes(evidence, fit, SHAPES_TRIED, SEARCHES, hardly_more=0.0).hypotheses)


def _is_near(other: Fit, fit: Fit) -> bool:
    """Whether a form explains most of it, inside the bounds of its search."""
    near = np.isfinite(other.log_evidence) and other.log_evidence > NEXT * fit.log_evidence
    return bool(near) and not all_on_bound(other.hypotheses[0])
