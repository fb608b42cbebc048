"""Members of a set that undo each other.

Where two effects do nearly the opposite, what they do together is the small difference of two large terms. It
shows by how much the two formulas differ, in noise that one of them has and in what neither is meant to say,
and hardly either cause: a stepper's damping that is 46 % too low and a friction that makes up for it to the
last tenth. Evidence does not see that; it takes formulas as exact.
"""

from __future__ import annotations

import numpy as np

from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit

AGAINST = (
    0.996  # minus the correlation, 5 degrees, from which on two exact ones do the same, one against the other
)
LEFT = 0.1  # of the smaller one's sum of squares, below which two members undo each other


def undo_each_other(evidence: Evidence, fit: Fit) -> bool:
    """Whether two members together do hardly anything beside what the smaller one does alone.

    Tolerances do not count here: what they could undo of each the other undoes. Errors of geometry
    are exact: there a small difference is one, but for two that do the same, as a camera that is late and the
    clock of the only arm.
    """
    likelihood = evidence.likelihood
    if len(fit.hypotheses) < 2:
        return False
    done = [likelihood.combined(h.regressors, a) for h, a in zip(fit.hypotheses, fit.amplitudes, strict=True)]
    gram = np.array([[likelihood.plain_gram(a, b).item() for b in done] for a in done])
    sizes = np.diag(gram)
    others = ~np.eye(len(done), dtype=bool)
    if likelihood.exact:
        against = gram < -AGAINST * np.sqrt(sizes[:, None] * sizes)
        return bool(against[others].any())
    together = sizes[:, None] + sizes + 2.0 * gram
    undone = together < LEFT * np.minimum(sizes[:, None], sizes)
    return bool(undone[others].any())
