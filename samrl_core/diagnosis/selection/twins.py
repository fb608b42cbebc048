"""Effects that these recordings cannot tell apart: whoever explains as much with no more freedom.

Evidence also weighs how probable a size was before any data. That is worth something between formulas that
differ; two that do the same are one, whichever prior likes its numbers better.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import subspace_angles

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis

AS_MUCH = 3.0  # [nat] of likelihood, within which two errors of geometry explain the same
NEARLY_ALL = 1.0  # [nat] likewise of two formulas: noise decides, or the widths of priors
MOST_PRIOR = 12.0  # [nat] of evidence, at most, that priors and searches make of it
FREER = 6.0  # [nat] of evidence that more numbers cost where they do the same, at most
FEW = 4.0  # shapes tried for each that does as well
MOST = 5  # that are named beside the chosen one
SAME_RAD = 0.35  # a shift of stamps by 4 ms is within it of one by 100 ms, at ordinary motion


def find_twins(evidence: Evidence, chosen: Fit, rivals: Sequence[Fit]) -> list[Fit]:
    """Rivals that leave as little as the chosen set, with no more amplitudes.

    Of formulas with shapes it must not take a lucky one: most that were tried do as well. A mass on a slide
    weighs the same wherever it hangs; one that mimics a denser link of a pendulum hangs at one distance.

    What does the same in whatever recordings may have more: fewer numbers are then no sign of the cause. So
    may what does all of it in these images, where little but its prior speaks against it: from one distance a
    camera that sits elsewhere sees what one with another image centre does.
    """
    exact = evidence.likelihood.exact
    most = find_misfit(evidence, chosen) + (AS_MUCH if exact else NEARLY_ALL)
    freedom = sum(len(a) for a in chosen.amplitudes)
    found = [
        r
        for r in rivals
        if (
            sum(len(a) for a in r.amplitudes) <= freedom
            or _does_it_always(evidence, chosen, r)
            or _does_it_here(evidence, chosen, r)
        )
        and np.isfinite(r.log_evidence)
        and (exact or (r.log_evidence > chosen.log_evidence - MOST_PRIOR and _is_free(r.hypotheses[0])))
        and find_misfit(evidence, r) <= most
    ]
    return found[:MOST]


def _does_it_always(evidence: Evidence, chosen: Fit, rival: Fit) -> bool:
    """Whether an effect alone can be another alone, by geometry and not by these recordings."""
    if len(chosen.hypotheses) != 1 or len(rival.hypotheses) != 1:
        return False
    return chosen.hypotheses[0].form.is_done_by(evidence.likelihood.trials[0], rival.hypotheses[0].name)


def _does_it_here(evidence: Evidence, chosen: Fit, rival: Fit) -> bool:
    """Whether an effect alone can be another alone in these images, for about as much evidence."""
    of_images = evidence.likelihood.trials[0].kind == "images"
    if not of_images or len(chosen.hypotheses) != 1 or len(rival.hypotheses) != 1:
        return False
    near = rival.log_evidence > chosen.log_evidence - FREER
    return near and does_the_same(evidence.likelihood, chosen.hypotheses[0], rival.hypotheses[0])


def _is_free(h: Hypothesis) -> bool:
    """Whether a fit does not owe its success to one shape among many."""
    return h.tried <= FEW * h.as_good


def principal_angle(likelihood: Likelihood, a: Hypothesis, b: Hypothesis) -> float:
    """Smallest angle [rad] between what two effects can do to the residuals that tolerances do not undo."""
    return float(np.min(_angles(likelihood, a, b)))


def does_the_same(likelihood: Likelihood, a: Hypothesis, b: Hypothesis) -> bool:
    """Whether all that the smaller of two effects does lies within `SAME_RAD` of what the other can do."""
    return float(np.max(_angles(likelihood, a, b))) < SAME_RAD


def _angles(likelihood: Likelihood, a: Hypothesis, b: Hypothesis) -> np.ndarray:
    spaces = []
    for h in (a, b):
        columns = [
            likelihood.whitened(likelihood.prediction(h.regressors, unit * spread))
            for unit, spread in zip(np.eye(len(h.mean)), h.spread, strict=True)
        ]
        spaces.append(np.stack(columns, axis=1))
    return subspace_angles(*spaces)


def find_misfit(evidence: Evidence, fit: Fit) -> float:
    """Negative log likelihood [nat] of what a fit leaves, tolerances counted."""
    k, rest = evidence.correlation_time, evidence.remainder(fit)
    inside = evidence.likelihood.tolerated(rest, k)
    return 0.5 * float(rest @ rest - rest @ inside) / k
