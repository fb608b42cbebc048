"""Effects at places with shapes held, and the evidence of a set of them.

Evidence is the marginal likelihood over amplitudes with their Gaussian priors: it weighs fit against
freedom without a separate penalty. Residuals of a model that is not quite right are correlated in time; the
data count is therefore divided by their correlation time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg, optimize

from samrl_core.diagnosis.effects.effect import Effect
from samrl_core.diagnosis.effects.form import Form, Shape
from samrl_core.diagnosis.residuals.equations import Columns
from samrl_core.diagnosis.residuals.likelihood import Likelihood, Regressors
from samrl_core.diagnosis.residuals.observed import Observed

ONSET = "onset"  # shape of any effect that was switched on within the recordings [s]
PLAUSIBLE = 1.7  # times the catalogue's range, for quantities that do not scale with the arm
BOUND_MARGIN = 0.02  # of the log range: a shape this close to its bound counts as on it


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One effect at one place with its shape held."""

    effect: Effect[Any]
    form: Form[Any]
    shape: Shape
    regressors: Regressors
    mean: np.ndarray  # (p,) prior
    spread: np.ndarray  # (p,)
    gram: np.ndarray  # (p, p) without tolerances
    moment: np.ndarray  # (p,) likewise
    tried: int = 1  # shapes and forms that were searched
    cost: float = 0.0  # [nat] of the effect before these data
    as_good: float = 1.0  # of the shapes that were tried: how many do as well as the best, itself included

    @property
    def place(self) -> str:
        """Contract's name of the place."""
        return self.form.place.name

    @property
    def name(self) -> str:
        """`family@place`."""
        return f"{self.effect.family}@{self.place}"


@dataclass(frozen=True, eq=False)
class Fit:
    """Posterior of a set of hypotheses."""

    hypotheses: tuple[Hypothesis, ...]
    amplitudes: tuple[np.ndarray, ...]
    covariance: np.ndarray  # of all amplitudes in order
    log_evidence: float  # against no effect [nat]

    def parts(self) -> Iterator[tuple[Hypothesis, np.ndarray, np.ndarray]]:
        """Each hypothesis with its amplitudes (p,) and their covariance (p, p)."""
        start = 0
        for h, amplitudes in zip(self.hypotheses, self.amplitudes, strict=True):
            block = slice(start, start + len(amplitudes))
            start += len(amplitudes)
            yield h, amplitudes, self.covariance[block, block]


def hypothesis(
    likelihood: Likelihood, effect: Effect[Any], form: Form[Any], shape: Shape
) -> Hypothesis | None:
    """Evaluate an effect's regressors; None where nothing of it is seen in these recordings."""
    columns = [form.columns(trial, shape) for trial in likelihood.trials]
    if ONSET in shape:
        columns = [_from(trial, c, shape[ONSET]) for trial, c in zip(likelihood.trials, columns, strict=True)]
    regressors = likelihood.regressors(columns)
    if regressors.empty:
        return None
    gram = likelihood.plain_gram(regressors, regressors)
    if not np.isfinite(gram).all() or float(np.max(np.diag(gram))) <= 0:
        return None
    mean, spread = form.prior(likelihood.trials[0], shape)
    moment = likelihood.plain_moment(regressors)
    cost = effect.prior_cost + form.cost(likelihood.trials, shape)
    return Hypothesis(effect, form, shape, regressors, mean, spread, gram, moment, cost=cost)


def _from(trial: Observed, columns: Columns, onset: float) -> Columns:
    """Columns that are zero until an onset [s] after the start of their recording."""
    there = {channel: trial.elapsed(channel) >= onset for channel in trial.channels}
    return {key: rows * there[key[0]] for key, rows in columns.items()}


class Evidence:
    """Marginal likelihoods of sets of hypotheses on one likelihood."""

    def __init__(self, likelihood: Likelihood, correlation_time: float = 2.0) -> None:
        """`correlation_time` in samples: how many count as one."""
        self.likelihood, self.correlation_time = likelihood, correlation_time

    def fit(self, hypotheses: Sequence[Hypothesis], at_borders: bool = False) -> Fit:
        """Posterior amplitudes and log evidence of a set.

        `at_borders` takes what is possible next to an impossible optimum, where a search may begin.
        """
        k = self.correlation_time
        sizes = [len(h.mean) for h in hypotheses]
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        total = int(starts[-1])
        gram = np.zeros((total, total))
        for i, a in enumerate(hypotheses):
            rows = slice(starts[i], starts[i + 1])
            gram[rows, rows] = a.gram
            for j in range(i + 1, len(hypotheses)):
                columns = slice(starts[j], starts[j + 1])
                cross = self.likelihood.plain_gram(a.regressors, hypotheses[j].regressors)
                gram[rows, columns], gram[columns, rows] = cross, cross.T
        moment = np.concatenate([h.moment for h in hypotheses])
        mean = np.concatenate([h.mean for h in hypotheses])
        spread = np.concatenate([h.spread for h in hypotheses])
        projected = np.hstack([h.regressors.projected for h in hypotheses])
        shrink = self.likelihood.shrink(k)
        gram = (gram - projected.T @ (shrink[:, None] * projected)) / k
        moment = (moment - projected.T @ (shrink * self.likelihood.y_projected)) / k
        # In units of the prior's spread all scales are alike, whatever the physical units.
        scaled = spread[:, None] * gram * spread
        factor = linalg.cho_factor(scaled + np.eye(total))
        rest = spread * (moment - gram @ mean)
        step = linalg.cho_solve(factor, rest)
        log_evidence = float(
            mean @ moment
            - 0.5 * mean @ gram @ mean
            + 0.5 * rest @ step
            - np.sum(np.log(np.diag(factor[0])))
            - sum(np.log(h.tried) + h.cost for h in hypotheses)
        )
        covariance = spread[:, None] * linalg.cho_solve(factor, np.eye(total)) * spread
        free = mean + spread * step
        tried = _at_borders(hypotheses, starts, free, covariance) if at_borders else [(free, 0.0)]
        for amplitudes, loss in tried:
            parts = tuple(amplitudes[a:b] for a, b in zip(starts[:-1], starts[1:], strict=True))
            if self._are_possible(hypotheses, parts):
                return Fit(tuple(hypotheses), parts, covariance, log_evidence - loss)
        parts = tuple(free[a:b] for a, b in zip(starts[:-1], starts[1:], strict=True))
        return Fit(tuple(hypotheses), parts, covariance, -np.inf)

    def _are_possible(self, hypotheses: Sequence[Hypothesis], parts: Sequence[np.ndarray]) -> bool:
        """Whether each amplitude is; what only one recording has reached (a tight spot, say), if in that."""
        return all(
            any(h.form.is_admissible(t, h.shape, a) for t in self.likelihood.trials)
            and not implausible(h, self.likelihood.trials[0], a)
            for h, a in zip(hypotheses, parts, strict=True)
        )

    def remainder(self, fit: Fit) -> np.ndarray:
        """Residuals (N,) after a fit."""
        y = self.likelihood.y
        for h, a in zip(fit.hypotheses, fit.amplitudes, strict=True):
            y = self.likelihood.minus(h.regressors, a, y)
        return y

    def screen(self, effects: Sequence[Effect[Any]]) -> list[Hypothesis]:
        """Every effect at every place, form and grid shape that can be seen."""
        out: list[Hypothesis] = []
        trial = self.likelihood.trials[0]
        for effect in effects:
            if effect.why_unobservable(trial) is not None:
                continue
            for place in effect.places(trial):
                # Of the recording that shows most: the limit of a law's output is not reached in all.
                forms = max((effect.forms(t, place) for t in self.likelihood.trials), key=len)
                tried = max(1, sum(len(form.shapes) for form in forms))
                for form in forms:
                    for shape in form.shapes:
                        h = hypothesis(self.likelihood, effect, form, shape)
                        if h is not None:
                            out.append(replace(h, tried=tried))
        return out

    def refine(self, fit: Fit, index: int, evaluations: int = 30, at_borders: bool = False) -> Fit:
        """Search the shape of one hypothesis of a set, the others held; never returns a worse fit."""
        start = fit.hypotheses[index]
        names = [n for n in start.form.refine if n in start.shape]
        if not names:
            return fit
        bounds = np.log([start.form.refine[n] for n in names])
        best = fit

        def negative(logs: np.ndarray) -> float:
            nonlocal best
            inside = np.clip(logs, bounds[:, 0], bounds[:, 1])
            shape = {**start.shape, **dict(zip(names, np.exp(inside).tolist(), strict=True))}
            h = hypothesis(self.likelihood, start.effect, start.form, shape)
            if h is None:
                return 1e12
            others = list(fit.hypotheses)
            others[index] = replace(h, tried=start.tried, as_good=start.as_good)
            trial_fit = self.fit(others, at_borders)
            if trial_fit.log_evidence > best.log_evidence:
                best = trial_fit
            outside = float(np.sum((logs - inside) ** 2))
            value = trial_fit.log_evidence
            return (1e12 if not np.isfinite(value) else -value) + 1e3 * outside

        origin = np.log([start.shape[n] for n in names])
        simplex = np.vstack([origin] + [origin + start.form.step * e for e in np.eye(len(names))])
        optimize.minimize(
            negative,
            origin,
            method="Nelder-Mead",
            options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 5e-3, "fatol": 0.05},
        )
        return best


def _at_borders(
    hypotheses: Sequence[Hypothesis], starts: np.ndarray, free: np.ndarray, covariance: np.ndarray
) -> Iterator[tuple[np.ndarray, float]]:
    """Amplitudes (p,) that may be best, and what they lose [nat]: the free ones, then those on a border.

    Where no amplitude may be negative and the free best one is, the best possible one is zero, and the others
    follow: the posterior is a Gaussian. A shape that is only nearly right often puts it there.
    """
    yield free, 0.0
    vanish = [
        int(starts[i]) + k for i, h in enumerate(hypotheses) for k in h.form.may_vanish if len(h.mean) > 1
    ]
    found = []
    for k in vanish:
        if free[k] < 0.0:
            follow = covariance[:, k] / covariance[k, k]
            found.append((free - follow * free[k], 0.5 * float(free[k] ** 2 / covariance[k, k])))
    yield from sorted(found, key=lambda item: item[1])


def implausible(h: Hypothesis, trial: Observed, amplitudes: np.ndarray) -> bool:
    """Whether a relative or angular parameter lies far outside of what the catalogue has ever seen."""
    ranges = {
        p.name: PLAUSIBLE * max(abs(p.low), abs(p.high))
        for p in h.effect.parameters
        if p.unit in ("1", "rad") and p.bounded
    }
    if not ranges:
        return False
    values = h.form.parameters(trial, h.shape, amplitudes)
    return any(abs(value) > ranges.get(name.partition("[")[0], np.inf) for name, value in values.items())


def is_there(h: Hypothesis, members: Sequence[Hypothesis]) -> bool:
    """Whether a member is the same effect at the same place, or one of the two contains the other.

    A friction that depends on the direction has a mean, which is Coulomb's. Both at one joint are one law,
    whose sign has another shape.
    """
    return any(
        h.place == m.place
        and (
            h.effect.family == m.effect.family
            or h.effect.family in m.effect.contains
            or m.effect.family in h.effect.contains
        )
        for m in members
    )


def on_bound(h: Hypothesis) -> list[str]:
    """Reported shapes that ended on a bound of their search."""
    reported = {p.name for p in h.effect.parameters} | set(h.effect.renamed_shapes)
    return [name for name in all_on_bound(h) if name in reported]


def all_on_bound(h: Hypothesis) -> list[str]:
    """The same with shapes that no report shows: another form of the family may fit inside its bounds."""
    out = []
    for name, (low, high) in h.form.refine.items():
        if name in h.shape:
            part = (np.log(h.shape[name]) - np.log(low)) / (np.log(high) - np.log(low))
            if not BOUND_MARGIN < part < 1 - BOUND_MARGIN:
                out.append(name)
    return out
