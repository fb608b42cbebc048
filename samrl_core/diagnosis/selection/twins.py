"""Effects that these recordings cannot tell apart: whoever explains as much with no more freedom.

Evidence also weighs how probable a size was before any data. Between formulas that is worth something; two
rigid errors that move the target alike are one, whichever prior likes its numbers better.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import subspace_angles

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, Hypothesis

AS_MUCH = 3.0  # [nat] of likelihood, within which two explain the same
MOST = 5  # that are named beside the chosen one
SAME_RAD = 0.35  # a shift of stamps by 4 ms is within it of one by 100 ms, at ordinary motion


def find_twins(evidence: Evidence, chosen: Fit, rivals: Sequence[Fit]) -> list[Fit]:
    """Rivals that leave as little as the chosen set, with no more amplitudes, where effects are exact."""
    if not evidence.likelihood.exact:
        return []
    best = _misfit(evidence, chosen) + AS_MUCH
    freedom = sum(len(a) for a in chosen.amplitudes)
    found = [
        r
        for r in rivals
        if sum(len(a) for a in r.amplitudes) <= freedom
        and np.isfinite(r.log_evidence)
        and _misfit(evidence, r) <= best
    ]
    return found[:MOST]


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


def _misfit(evidence: Evidence, fit: Fit) -> float:
    """Negative log likelihood [nat] of what a fit leaves, tolerances counted."""
    k, rest = evidence.correlation_time, evidence.remainder(fit)
    inside = evidence.likelihood.tolerated(rest, k)
    return 0.5 * float(rest @ rest - rest @ inside) / k
