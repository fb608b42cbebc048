"""Sizes of named effects as they are, what their own tolerances take of them put back.

A likelihood that judges whether there is an effect lets every quantity be off within its tolerance, that of
the effect too: a camera turned by 10 mrad is an effect of 9 and a tolerance of 1, or of 11 and -1. Its size
beyond tolerance is therefore known no better than the tolerance is wide, however much the data tell. What has
to be corrected is the sum, which is known as well as the data tell it: a Gaussian of effect and tolerance
together, in closed form (van Trees 1968, section 2.4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg

from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit


def find_whole_sizes(evidence: Evidence, fit: Fit) -> Fit:
    """The fit with amplitudes and covariance of each effect and its own tolerance together.

    What recordings cannot tell whatever their noise (`Form.find_unresolved`) widens the covariance.

    Effects whose form names no tolerance of its own (`Form.find_own_tolerances`) stay as they are, but for
    their covariance with the others.
    """
    likelihood, k = evidence.likelihood, evidence.correlation_time
    trial = likelihood.trials[0]
    parts = [h.form.find_own_tolerances(trial) for h in fit.hypotheses]
    if all(part is None for part in parts):
        return fit
    columns = next(part.shape[1] for part in parts if part is not None)
    own = np.concatenate(
        [np.zeros((len(h.spread), columns)) if part is None else part
         for h, part in zip(fit.hypotheses, parts, strict=True)]
    )  # fmt: skip
    projected = np.hstack([h.regressors.projected for h in fit.hypotheses])
    follows = np.eye(len(own)) - own @ likelihood.find_tolerance_sizes(projected, k)
    left = own @ likelihood.tolerance_sizes(evidence.remainder(fit), k)
    unresolved = linalg.block_diag(*(h.form.find_unresolved(trial, h.shape) for h in fit.hypotheses))
    tolerated = own @ likelihood.tolerance_covariance(k) @ own.T
    covariance = unresolved + follows @ fit.covariance @ follows.T + tolerated
    ends = np.cumsum([len(a) for a in fit.amplitudes])[:-1]
    whole = np.concatenate(fit.amplitudes) + left
    return replace(fit, amplitudes=tuple(np.split(whole, ends)), covariance=covariance)
