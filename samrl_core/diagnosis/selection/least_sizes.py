"""The least size of each effect that recordings show: what a verdict of no gap leaves possible.

With G the information on an effect's amplitudes, what tolerances may do taken off it, and S their prior
covariance, the log evidence of amplitudes a is expected to be a' G C G a / 2 less what the effect costs
before the data, with C = S (S G S + I)^-1 S as in `Evidence.fit`. Where that is what a name needs, noise
decides: about every other error of that size is named. Beside it the same were nothing else off by anything,
the bound by information: what lies between the two are tolerances, which their owner may know better.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.result import LeastSize
from samrl_core.diagnosis.selection.hypothesis import Evidence, Hypothesis, implausible


def least_sizes(evidence: Evidence, effects: Sequence[Effect[Any]], threshold: float) -> list[LeastSize]:
    """The least size of each parameter of each effect, alone and at every place, in the library's order.

    Args:
        evidence: of the fitted recordings.
        effects: that may be named.
        threshold: log evidence that a name needs [nat].
    """
    likelihood, k = evidence.likelihood, evidence.correlation_time
    best: dict[tuple[str, str], tuple[float, float, Hypothesis, int]] = {}
    for h in evidence.screen(effects):
        stated = _sizes(h, likelihood.tempered_gram(h.regressors, h.regressors, k), threshold)
        exact = _sizes(h, h.gram / k, threshold)
        for index, name in enumerate(h.form.amplitudes):
            before = best.get((h.name, name))
            if before is None or stated[index] < before[0]:
                best[h.name, name] = float(stated[index]), float(exact[index]), h, index
    return [_state_least(evidence, h, index, size, least) for size, least, h, index in best.values()]


def _sizes(h: Hypothesis, gram: np.ndarray, threshold: float) -> np.ndarray:
    """Amplitudes (p,) whose expected log evidence is the threshold, each alone."""
    scaled = h.spread[:, None] * gram * h.spread
    wide = scaled + np.eye(len(scaled))
    cost = 0.5 * float(np.linalg.slogdet(wide)[1]) + float(np.log(h.tried)) + h.cost
    seen = np.diag(scaled @ np.linalg.solve(wide, scaled)) / h.spread**2
    return np.sqrt(2.0 * (threshold + cost) / np.maximum(seen, 1e-300))


def _state_least(evidence: Evidence, h: Hypothesis, index: int, size: float, least: float) -> LeastSize:
    """In the effect's own parameter and unit."""
    trial, amplitude = evidence.likelihood.trials[0], list(h.form.amplitudes)[index]
    named = h.form.parameters(trial, h.shape, np.zeros(len(h.spread)))
    name = amplitude if amplitude in named else next(iter(named))
    ends = []
    for one in (-size, size, -least, least):
        amplitudes = np.zeros(len(h.spread))
        amplitudes[index] = one
        value = h.form.parameters(trial, h.shape, amplitudes)[name]
        ends.append(float("nan") if implausible(h, trial, amplitudes) else value)
    unit = next(p.unit for p in h.effect.parameters if p.name == name)
    return LeastSize(h.name, name, unit, (ends[0], ends[1]), (ends[2], ends[3]))
