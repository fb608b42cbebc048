"""How sure: probabilities of rivals, and intervals of parameters."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from samrl_core.diagnosis.result import ParameterEstimate
from samrl_core.diagnosis.selection.hypothesis import Evidence, Fit
from samrl_core.diagnosis.selection.shape_posterior import shape_posterior
from samrl_core.diagnosis.selection.whole_sizes import find_whole_sizes

TEMPERATURE = 2.0  # of probabilities [nat]; a temperature of one trusts every formula fully
RELATIVE_TEMPERATURE = 0.0025  # of the best evidence, likewise: a tie within a quarter of a percent is one
REMAINDER_TEMPERATURE = 0.5  # of what the best leaves unexplained, likewise
SAMPLES = 400
MISSED = 2.0  # times the deficit, that an effect may be worth before that is taken to have missed it
REMAINDER_TO_FORMULA = 0.3  # the same per relative size of what the formula leaves where it acts


def probabilities(
    fits: Sequence[Fit],
    remaining: float = 0.0,
    tied: Collection[int] = (),
    denied: Collection[int] = (),
    told: Collection[int] = (),
) -> np.ndarray:
    """Probability of each rival set, tempered; those of `tied` indices are as probable as the first.

    Those of `denied` indices have none. Formulas are not exact, so that a tie is relative to all that they
    explain; not with those of `told` indices, which recordings tell from the first (`find_told_apart`).

    `remaining` [nat] is what the best of them leaves unexplained: formulas that are wrong by so much are not
    told apart by less.
    """
    evidence = np.array([f.log_evidence for f in fits])
    # What the exchanged member itself adds, where several effects were named.
    there = evidence[np.isfinite(evidence)]  # a rival that is impossible here has none
    adds = float(np.max(there) - np.min(there)) if len(fits[0].hypotheses) > 1 else float(np.max(there))
    least = max(TEMPERATURE, REMAINDER_TEMPERATURE * remaining)
    temperature = max(least, RELATIVE_TEMPERATURE * adds)
    evidence[list(tied)] = evidence[0]
    evidence[list(denied)] = -np.inf
    weights = np.exp((evidence - np.max(evidence)) / temperature)
    for i in told:
        weights[i] = weights[0] * np.exp((evidence[i] - evidence[0]) / least)
    return weights / np.sum(weights)


def estimates(
    evidence: Evidence, fit: Fit, index: int, rng: np.random.Generator
) -> dict[str, ParameterEstimate]:
    """Parameters of one effect of a fit with 95 % intervals.

    Amplitudes and shapes are sampled from their common posterior (`shape_posterior`), and both vary by what
    another formula of the same effect would make of them: the better this one explains the residual where it
    acts, the less (`formula_deviation`). What is off within the effect's own tolerance is part of it
    (`find_whole_sizes`).
    """
    formula = formula_deviation(evidence, fit, index)
    fit = find_whole_sizes(evidence, fit)
    h = fit.hypotheses[index]
    trial = evidence.likelihood.trials[0]
    units = {p.name: p.unit for p in h.effect.parameters}
    posterior = shape_posterior(evidence, fit, index)
    values: dict[str, list[float]] = {}
    for _ in range(SAMPLES):
        samples = h.form.sample_parameters(trial, *posterior.sample(rng, formula), rng)
        for name, value in samples.items():
            values.setdefault(name, []).append(value)
    best = h.form.parameters(trial, h.shape, fit.amplitudes[index])
    out = {}
    for name, value in best.items():
        low, high = np.quantile(values[name], [0.025, 0.975])
        out[name] = ParameterEstimate(
            float(value),
            units.get(name.partition("[")[0], ""),
            (float(min(low, value)), float(max(high, value))),
        )
    return out


def _worth(evidence: Evidence, fit: Fit, index: int) -> float:
    """Log evidence [nat] that one effect of a fit adds to the others."""
    others = [h for k, h in enumerate(fit.hypotheses) if k != index]
    return fit.log_evidence - (evidence.fit(others).log_evidence if others else 0.0)


def formula_deviation(evidence: Evidence, fit: Fit, index: int) -> float:
    """Relative standard deviation that the parameters of one effect have because its formula is not exact.

    A formula that is wrong by a relative size leaves about its square of the residual's energy; the root of
    the share left is therefore how far another formula could move the amplitude.
    """
    likelihood, k = evidence.likelihood, evidence.correlation_time
    h, rest = fit.hypotheses[index], evidence.remainder(fit)
    there = set(h.regressors.blocks)
    # Undo this effect alone: what it had to explain.
    alone = likelihood.minus(h.regressors, -fit.amplitudes[index], rest)
    before, after = likelihood.deficit(alone, k, there), likelihood.deficit(rest, k, there)
    # Where transforms that nobody states could be nearly the same, the deficit misses what it explains.
    if likelihood.exact and (worth := _worth(evidence, fit, index)) > MISSED * before:
        before = worth
    return float(
        np.hypot(
            h.form.deviation, REMAINDER_TO_FORMULA * np.sqrt(np.clip(after / max(before, 1e-9), 0.0, 1.0))
        )
    )
