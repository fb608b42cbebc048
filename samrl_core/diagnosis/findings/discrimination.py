"""How well a recording would tell rivals apart, whatever it records: before it is made."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.residuals.observed import Observed
from samrl_core.diagnosis.selection.hypothesis import Fit, Hypothesis, hypothesis
from samrl_core.diagnosis.verdict.confidence import TEMPERATURE
from samrl_core.diagnosis.verdict.rules import VerdictSettings

FILE = "next.yaml"
AS_ONE = 2.0  # samples that count as one: four to a period of the band's edge

Rivals = dict[str, tuple[Hypothesis, np.ndarray]]  # family@place -> the effect, its amplitudes (p,)


def find_rivals(fits: Sequence[Fit], names: Sequence[str]) -> Rivals:
    """First effects of fits that have one of these `family@place` names, the first fit of each name."""
    rivals: Rivals = {}
    for fit in fits:
        if (h := fit.hypotheses[0]).name in names:
            rivals.setdefault(h.name, (h, fit.amplitudes[0]))
    return rivals


def separation(discriminated: float) -> float:
    """Probability that the wrong one of two rivals leaves the ambiguity set, at a `discrimination` [nat].

    The log likelihood ratio of two Gaussian hypotheses has that mean, and twice that variance. The wrong one
    leaves where the ratio makes it less probable than `VerdictSettings.rival`.
    """
    if discriminated <= 0.0:
        return 0.0
    rival = VerdictSettings().rival
    needed = TEMPERATURE * np.log((1.0 - rival) / rival)
    return float(stats.norm.sf((needed - discriminated) / np.sqrt(2.0 * discriminated)))


def discrimination(virtual: Observed, rivals: Rivals) -> float:
    """Smallest energy [nat] over ordered pairs that remains when the wrong rival is fitted.

    Its amplitudes are: a shape (a delay, a stiffness) stays as these recordings gave it, so that rivals which
    only a shape tells apart differ by less than this.
    """
    likelihood = Likelihood([virtual])
    least = np.inf
    made = [(hypothesis(likelihood, h.effect, h.form, h.shape), a) for h, a in rivals.values()]
    for i, (truth, a) in enumerate(made):
        if truth is None:
            continue
        own = likelihood.combined(truth.regressors, a)
        energy = float(likelihood.tempered_gram(own, own, AS_ONE)[0, 0])
        for j, (wrong, _) in enumerate(made):
            if i == j or wrong is None:
                continue
            cross = likelihood.tempered_gram(wrong.regressors, own, AS_ONE)[:, 0]
            gram = likelihood.tempered_gram(wrong.regressors, wrong.regressors, AS_ONE)
            # Beyond what the wrong one does at its prior's mean, which is its presence where it has no size.
            whole = energy - 2.0 * float(wrong.mean @ cross) + float(wrong.mean @ gram @ wrong.mean)
            cross = cross - gram @ wrong.mean
            gram = gram + np.diag(1.0 / wrong.spread**2)
            least = min(least, 0.5 * (whole - float(cross @ np.linalg.solve(gram, cross))))
    return float(max(least, 0.0)) if np.isfinite(least) else 0.0
