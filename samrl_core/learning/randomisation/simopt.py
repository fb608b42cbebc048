"""SimOpt: a Gaussian over the model's parameters moves to where the model does what the cell did.

Chebotar et al. 2019, "Closing the Sim-to-Real Loop": parameters are sampled, the model is run with each, and
the next distribution makes the discrepancy from the real trajectories small on average, no farther from the
last one than a bound on their relative entropy. As there, the samples are weighted as in relative-entropy
policy search (Peters, Muelling and Altun 2010) and the Gaussian is fitted to them; a fit on few samples can
still go too far, so it is then taken back to the bound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.distributions import (
    BoundedNormal,
    Independent,
    ParameterDistribution,
    UniformBox,
    is_definite,
    log_mean_exp,
)
from samrl_core.learning.randomisation.space import Space
from samrl_core.learning.randomisation.strategy import Measure, Question, QuestionResult, nothing


@dataclass(frozen=True)
class SimOptSettings:
    """Sizes of the search.

    Raises:
        InputError: a number that is not positive, or samples too few to fit a Gaussian to.
    """

    iterations: int = 3  # as in the paper
    bound: float = 1.0  # KL(next || last) at most [nat]
    draws: int = 64  # samples per iteration

    def __post_init__(self) -> None:
        if self.iterations < 1 or not self.bound > 0.0 or self.draws < 4:
            raise InputError(
                f"iterations {self.iterations} must be at least 1, bound {self.bound} nat above 0, draws "
                f"{self.draws} at least 4"
            )


@dataclass(frozen=True, eq=False)
class SimOpt:
    """What is fitted, what is not, and how far each iteration went."""

    settings: SimOptSettings
    fitted: BoundedNormal
    others: Space | None  # numbers that no discrepancy speaks of: sampled from all of it
    steps: tuple[float, ...] = ()  # KL of each iteration [nat]
    measure: Measure = "discrepancy"

    @staticmethod
    def begin(fitted: Space, others: Space | None = None, settings: SimOptSettings | None = None) -> SimOpt:
        """Uniform over both."""
        return SimOpt(settings or SimOptSettings(), BoundedNormal.whole(fitted), others)

    @property
    def distribution(self) -> ParameterDistribution:
        """See `Strategy`: the rest first, then what is fitted."""
        return (
            self.fitted if self.others is None else Independent((UniformBox.whole(self.others), self.fitted))
        )

    def ask(self, rng: np.random.Generator) -> Question:
        """See `Strategy`: samples of the distribution, or nothing after the last iteration."""
        if len(self.steps) >= self.settings.iterations:
            return nothing(self.distribution.space)
        points = self.distribution.sample(rng, self.settings.draws)
        return Question(points, np.zeros(len(points), dtype=np.int64))

    def update(self, evidence: QuestionResult) -> SimOpt:
        """See `Strategy`; the results are discrepancies."""
        if not len(evidence.question):
            return self
        z = self.fitted.stretched(evidence.question.points[:, -len(self.fitted.space) :])
        weights = reps_weights(evidence.result, self.settings.bound)
        found = within_bound(self.fitted, z, weights, self.settings.bound)
        return replace(self, fitted=found, steps=(*self.steps, found.divergence_from(self.fitted)))


def reps_weights(cost: np.ndarray, bound: float) -> np.ndarray:
    """Weights (N,) of samples, sum 1: the least cost on average at KL(weights || uniform) <= bound.

    Peters et al. 2010: exp(-cost / eta), with eta where the dual eta bound + eta log mean exp(-cost / eta) is
    least.
    """
    spread = float(np.ptp(cost))
    if spread == 0.0:
        return np.full(len(cost), 1.0 / len(cost))
    relative_cost = (cost.min() - cost) / spread  # 0 for the best, -1 for the worst

    def dual(log_eta: float) -> float:
        eta = float(np.exp(log_eta))
        return eta * bound + eta * log_mean_exp(relative_cost / eta)

    # Below the lower end all weight is the best sample's, above the upper end all weigh the same.
    log_eta = minimize_scalar(dual, bounds=(np.log(1e-4), np.log(1e4)), method="bounded").x
    weights = np.exp(relative_cost / np.exp(log_eta))
    return weights / weights.sum()


def within_bound(last: BoundedNormal, z: np.ndarray, weights: np.ndarray, bound: float) -> BoundedNormal:
    """The Gaussian of weighted samples z (N, P), or as much of the way to it as the bound on KL allows.

    The way mixes first and second moments; KL(. || last) is convex along it and 0 at its beginning, so it
    grows all the way, and the end is found by bisection.
    """
    first = weights @ z
    second = (z.T * weights) @ z
    before = last.covariance + np.outer(last.mean, last.mean)

    def at(share: float) -> BoundedNormal | None:
        mean = (1.0 - share) * last.mean + share * first
        covariance = (1.0 - share) * before + share * second - np.outer(mean, mean)
        covariance = 0.5 * (covariance + covariance.T)
        return BoundedNormal(last.space, mean, covariance) if is_definite(covariance) else None

    def allowed(share: float) -> bool:
        found = at(share)
        return found is not None and found.divergence_from(last) <= bound

    if allowed(1.0):
        low = 1.0
    else:
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if allowed(middle) else (low, middle)
    found = at(low)
    return last if found is None else found
