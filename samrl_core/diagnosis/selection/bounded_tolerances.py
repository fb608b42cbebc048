"""What an effect explains that tolerances cannot, if they end somewhere.

A tolerance is a half width, and the likelihood takes it as a Gaussian: cheap, and right as long as data say
little. Where they say much, its tails do what no machine does. An encoder that is off by 0.08 rad is then
called a torque offset of six times what was stated. Here tolerances end, and the most probable ones within
their ends are found with the effect and without it: least squares with bounds (Stark and Parker 1995).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg, optimize

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.nominal import FLOOR_WIDTHS, OF_A_WIDTH, friction_turns
from samrl_core.diagnosis.residuals.trial import Trial
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit, hypothesis

DEVIATIONS = 3.0  # where a tolerance ends that was stated as a standard deviation, or by nobody


def evidence_beyond(evidence: Evidence, fit: Fit, width: float) -> float | None:
    """Log evidence [nat] of one effect against tolerances that end at `width` times what is stated.

    The least for any width of the sign of the tolerated friction, of which one is real. None where tolerances
    were stated as standard deviations, which have no end, or are no arm's.
    """
    first = evidence.likelihood.trials[0]
    if not isinstance(first, Trial) or len(fit.hypotheses) != 1:
        return None
    deviation = first.recording.arm.tolerances.deviation
    if deviation >= 1.0:
        return None
    # So wide that the end is as many standard deviations off as it is for what nobody stated.
    likelihood = Likelihood(evidence.likelihood.trials, width / (DEVIATIONS * deviation))
    k = evidence.correlation_time
    (was,) = fit.hypotheses
    h = hypothesis(likelihood, was.effect, was.form, was.shape)
    if h is None:
        return None
    rest = likelihood.minus(h.regressors, h.mean)
    outside = 0.5 * (float(likelihood.y @ likelihood.y) - float(rest @ rest)) / k
    gram, moment = likelihood.tolerance_gram() / k, likelihood.tolerance_moment(likelihood.y_projected) / k
    count, own = len(gram), len(h.mean)
    both = np.zeros((count + own, count + own))
    both[:count, :count] = gram
    cross = likelihood.tolerance_moment(h.regressors.projected) * h.spread / k
    both[:count, count:], both[count:, :count] = cross, cross.T
    inner = h.spread[:, None] * h.gram * h.spread / k
    both[count:, count:] = inner + np.eye(own)
    with_effect = np.concatenate(
        [
            moment - cross @ (h.mean / h.spread),
            h.spread * (h.moment / k) - inner @ (h.mean / h.spread),
        ]
    )
    _, volume = np.linalg.slogdet(both[count:, count:])  # of its amplitudes, as if nothing stood in for them
    occam = 0.5 * float(volume) + float(np.log(was.tried)) + h.cost
    turns, free, least = friction_turns(first), np.full(own, np.inf), np.inf
    for turn in FLOOR_WIDTHS:
        end = _ends(turns, count, turn)
        alone = _most(gram, moment, end)
        least = min(least, _most(both, with_effect, np.concatenate([end, free])) - alone)
    return least + outside - occam


def _ends(turns: Sequence[float | None], count: int, turn: float) -> np.ndarray:
    """Where each tolerance ends (count,) [standard deviations], if friction turns in that width [rad/s]."""
    ends = [DEVIATIONS if t is None else DEVIATIONS / OF_A_WIDTH if t == turn else 0.0 for t in turns]
    # Behind them: what differs from recording to recording, which has no end.
    return np.concatenate([ends, np.full(count - len(ends), np.inf)])


def _most(gram: np.ndarray, moment: np.ndarray, ends: np.ndarray) -> float:
    """Largest log likelihood [nat] that sizes within -ends..ends win; those without an end are Gaussian."""
    ended, free = np.flatnonzero((ends > 0.0) & np.isfinite(ends)), np.flatnonzero(np.isinf(ends))
    h, g, won = gram[np.ix_(ended, ended)], moment[ended], 0.0
    if len(free):  # solved for whatever the others are
        factor = linalg.cho_factor(gram[np.ix_(free, free)] + np.eye(len(free)))
        cross = gram[np.ix_(free, ended)]
        follow, alone = linalg.cho_solve(factor, cross), linalg.cho_solve(factor, moment[free])
        h, g, won = h - cross.T @ follow, g - cross.T @ alone, 0.5 * float(moment[free] @ alone)
    values, vectors = np.linalg.eigh(0.5 * (h + h.T))
    kept = values > 1e-10 * max(values[-1], 1e-300)
    root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
    target = (vectors[:, kept].T @ g) / np.sqrt(values[kept])
    x = optimize.lsq_linear(root, target, (-ends[ended], ends[ended]), method="bvls").x
    return won + float(g @ x - 0.5 * x @ h @ x)
