"""When a named effect began: claimed only where "it was there all along" is much less likely.

In each recording the effect's fitted prediction gets one size before a time and one after. Let L(b, a) be the
log likelihood of both, tolerances counted. The effect was there all along if one size serves both, b = a; it
began if b = 0. Both leave one size free, and the time is searched, so that the beginning must win by the
threshold and the logarithm of the times tried.

A formula that is not exact is weaker somewhere, maybe just where a recording begins. Sizes that scatter by
`FORMULA` win at most its square of the log likelihood that the law wins by itself (see `invariance`), and
that much is conceded to "all along" as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samrl_core.diagnosis.residuals.likelihood import Block, Likelihood
from samrl_core.diagnosis.selection.hypothesis import ONSET, Fit
from samrl_core.diagnosis.verdict.invariance import FORMULA

THRESHOLD = 12.0  # [nat] as for an effect
TIMES = 160  # that are tried in a recording
EARLY, LATE = 0.1, 0.95  # shares of a recording, between which a beginning can be told from always and never
ABSENT = 0.2  # of the later size, at most, before it began
THERE = 0.5  # of the fitted size, at least, after


def find_onsets(likelihood: Likelihood, fit: Fit, correlation: float) -> list[float | None]:
    """When the first effect of a fit began, per recording [s]; None where it was there all along or unseen.

    Args:
        likelihood: of the fitted recordings.
        fit: what was fitted; one that was switched on says when by itself.
        correlation: samples that count as one.
    """
    first = fit.hypotheses[0]
    if ONSET in first.shape:
        return [first.shape[ONSET]] * len(likelihood.trials)
    mine = likelihood.prediction(first.regressors, fit.amplitudes[0])
    rest = likelihood.y
    for h, amplitudes in zip(fit.hypotheses[1:], fit.amplitudes[1:], strict=True):
        rest = likelihood.minus(h.regressors, amplitudes, rest)
    return [_onset(likelihood, mine, rest, r, correlation) for r in range(len(likelihood.trials))]


def say_when_others_began(fit: Fit) -> tuple[str, ...]:
    """When further effects of a fit were switched on, in words; empty where all were there all along."""
    return tuple(
        f"{h.name} begins {h.shape[ONSET]:.2f} s after the start of each fitted recording"
        for h in fit.hypotheses[1:]
        if ONSET in h.shape
    )


def began_in(fit: Fit, onsets: Sequence[float | None]) -> dict[Block, float]:
    """When the first effect of a fit began in each block in which it acts [s]; `onsets` per recording."""
    blocks = fit.hypotheses[0].regressors.blocks
    acts = {block for block, rows in blocks.items() if np.any(rows)}
    return {b: onset for b in sorted(acts) if (onset := onsets[b[0]]) is not None}


def _onset(
    likelihood: Likelihood, prediction: np.ndarray, rest: np.ndarray, recording: int, correlation: float
) -> float | None:
    """When an effect of that prediction (N,) began in one recording [s]; `rest` (N,) is what it explains."""
    trial = likelihood.trials[recording]
    inside, elapsed = np.zeros(len(rest), dtype=bool), np.zeros(len(rest))
    for (r, channel, _), part in likelihood.blocks.items():
        if r == recording:
            inside[part], elapsed[part] = True, trial.elapsed(channel)
    mine = np.where(inside, prediction, 0.0)
    rest = rest - (prediction - mine)  # in other recordings it is as it was fitted
    times = np.linspace(0.0, LATE, TIMES + 1)[1:] * trial.duration
    # Stretches between two times, in their order: what lies before a time is a sum from the first on.
    stretch = np.searchsorted(times, elapsed, side="right")
    moment, gram = likelihood.by_group(mine, stretch, TIMES + 1, rest, correlation)
    total = float(np.sum(gram))
    if total <= 0.0:
        return None
    always = 0.5 * max(float(np.sum(moment)), 0.0) ** 2 / total
    needed = THRESHOLD + np.log(TIMES) + FORMULA**2 * always
    best, found = -np.inf, None
    for k in range(1, TIMES + 1):
        cut = [[np.sum(gram[:k, :k]), np.sum(gram[:k, k:])], [np.sum(gram[k:, :k]), np.sum(gram[k:, k:])]]
        sums = np.array([np.sum(moment[:k]), np.sum(moment[k:])])
        if cut[1][1] <= 0.0:
            continue
        later = sums[1] / cut[1][1]
        won = 0.5 * sums[1] * later - always
        if won <= max(best, needed) or later < THERE:
            continue
        before, after = np.linalg.pinv(np.array(cut), 1e-9, hermitian=True) @ sums
        if abs(before) <= ABSENT * abs(after):
            best, found = won, float(times[k - 1])
    # The first part is tried too: else what begins there would seem to begin at its end.
    return found if found is not None and found >= EARLY * trial.duration else None
