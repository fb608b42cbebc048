"""What all ways to randomise have in common, and the plainest of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.distributions import ParameterDistribution, UniformBox
from samrl_core.learning.randomisation.space import Space

# What is measured at the points that a strategy asks for: nothing; whether the actor succeeds in the model
# there; or how far the model there strays from what the cell was observed to do, before any actor is trained.
Measure = Literal["nothing", "success", "discrepancy"]


REAL2SIM, UNIFORM, ADR, SIMOPT = "real2sim", "uniform", "adr", "simopt"
RANDOMISATIONS = (REAL2SIM, UNIFORM, ADR, SIMOPT)


@dataclass(frozen=True, eq=False)
class Question:
    """Points to try."""

    points: np.ndarray  # (N, P) of the distribution's space
    label: np.ndarray  # (N,) int64, what the strategy remembers a point by

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class QuestionResult:
    """What came out at the points of a question.

    Raises:
        InputError: as many results as points, all finite, it must be.
    """

    question: Question
    result: np.ndarray  # (N,) 1 for success and 0 for failure, or the discrepancy

    def __post_init__(self) -> None:
        if self.result.shape != (len(self.question),) or not np.isfinite(self.result).all():
            raise InputError(
                f"{len(self.question)} points were asked about, results are {self.result}; give one finite "
                f"number each"
            )


class Strategy(Protocol):
    """A way to choose what the model is randomised over. Immutable: `update` returns the next one."""

    @property
    def distribution(self) -> ParameterDistribution:
        """What training samples from now."""
        ...

    @property
    def measure(self) -> Measure:
        """What is to be measured at the points of a question."""
        ...

    def ask(self, rng: np.random.Generator) -> Question:
        """What to try next; no point when there is nothing to ask any more."""
        ...

    def update(self, evidence: QuestionResult) -> Strategy:
        """The strategy after that."""
        ...


def nothing(space: Space) -> Question:
    """A question without a point."""
    return Question(np.zeros((0, len(space))), np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, eq=False)
class Uniform:
    """Uniform domain randomisation: the whole space, always (Tobin et al. 2017)."""

    space: Space
    measure: Measure = "nothing"

    @property
    def distribution(self) -> UniformBox:
        """See `Strategy`."""
        return UniformBox.whole(self.space)

    def ask(self, rng: np.random.Generator) -> Question:
        """See `Strategy`."""
        return nothing(self.space)

    def update(self, evidence: QuestionResult) -> Uniform:
        """See `Strategy`."""
        return self
