"""Which of two beliefs about a cell an image speaks for: that it is calibrated, or that nobody did.

The two differ in how far the numbers may be off that an episode finds and does not change: a thread's length,
the camera's error. A belief that is too narrow cannot say so, and one that is too wide knows less of every
cell than it could. The ratio of their evidence follows from the wider one's posterior alone: it is the mean,
over that posterior, of the ratio of the two priors (generalised Savage-Dickey ratio: Verdinelli and Wasserman
1995, "Computing Bayes factors using a generalization of the Savage-Dickey density ratio").
"""

from __future__ import annotations

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.model.real2sim.real2sim import Estimate


def log_evidence_ratio(narrow: Estimate, wide: Estimate, posterior: Estimate) -> float:
    """Natural logarithm of the evidence for the narrow belief over that for the wide one.

    Args:
        narrow: a belief before an image.
        wide: another one before it, of the same parameters, mean and correlations; known no better.
        posterior: the wide one after it.

    Raises:
        InputError: other parameters, other means, or a narrow belief that is the wider one somewhere.
    """
    if not narrow.names == wide.names == posterior.names or not np.array_equal(narrow.values, wide.values):
        raise InputError("two beliefs are weighed in the same parameters, about the same values")
    differ = np.diag(narrow.covariance) != np.diag(wide.covariance)
    if not differ.any():
        return 0.0
    at = np.ix_(differ, differ)
    before, after = narrow.covariance[at], wide.covariance[at]
    closer = np.linalg.inv(before) - np.linalg.inv(after)
    if np.linalg.eigvalsh(closer).min() < 0.0:
        names = [n for n, d in zip(wide.names, differ, strict=True) if d]
        raise InputError(f"the narrow belief in {', '.join(names)} must be known better in every direction")
    found = (posterior.values - wide.values)[differ]
    spread = np.eye(len(found)) + posterior.covariance[at] @ closer
    scales = np.linalg.slogdet(after)[1] - np.linalg.slogdet(before)[1] - np.linalg.slogdet(spread)[1]
    return 0.5 * float(scales - found @ closer @ np.linalg.solve(spread, found))
