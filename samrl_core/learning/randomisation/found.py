"""SAM-RL's own way as one more strategy: begin where Real2Sim found the cell (Algorithm 1, lines 16, 17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.distributions import Mixture, ParameterDistribution, UniformBox
from samrl_core.learning.randomisation.of_task import starts_of
from samrl_core.learning.randomisation.space import Space
from samrl_core.learning.randomisation.strategy import Measure, Question, QuestionResult, nothing
from samrl_core.learning.states.visited import VisitedStates


@dataclass(frozen=True)
class FoundSettings:
    """How much of training is about what was found.

    Raises:
        InputError: a number that is no share.
    """

    share: float = 0.25  # of episodes that begin about a start that was found
    spread: float = 0.02  # width about it [width of the space's bounds]

    def __post_init__(self) -> None:
        if not (0.0 < self.share < 1.0 and 0.0 < self.spread <= 1.0):
            raise InputError(f"share {self.share} and spread {self.spread} must be above 0, share below 1")


@dataclass(frozen=True, eq=False)
class Real2SimUpdated:
    """Starts as the task declares them, and some of them about those that Real2Sim has estimated."""

    settings: FoundSettings
    over: Space
    centers: np.ndarray  # (N, P)
    measure: Measure = "nothing"

    @staticmethod
    def begin(space: Space, settings: FoundSettings | None = None) -> Real2SimUpdated:
        """Before anything was found."""
        return Real2SimUpdated(settings or FoundSettings(), space, np.zeros((0, len(space))))

    @property
    def distribution(self) -> ParameterDistribution:
        """See `Strategy`."""
        whole, s = UniformBox.whole(self.over), self.settings
        if not len(self.centers):
            return whole
        half = 0.5 * s.spread * (self.over.upper - self.over.lower)
        near = tuple(
            UniformBox(
                self.over, np.maximum(c - half, self.over.lower), np.minimum(c + half, self.over.upper)
            )
            for c in self.centers
        )
        weights = np.array([1.0 - s.share, *[s.share / len(near)] * len(near)])
        return Mixture((whole, *near), weights / weights.sum())

    def ask(self, rng: np.random.Generator) -> Question:
        """See `Strategy`: nothing; the cell answers unasked."""
        return nothing(self.over)

    def update(self, evidence: QuestionResult) -> Real2SimUpdated:
        """See `Strategy`: the points are estimates of starts, whatever their results.

        Raises:
            InputError: a start outside the space.
        """
        points = self.over.points(evidence.question.points)
        outside = ((points < self.over.lower) | (points > self.over.upper)).any(axis=1)
        if outside.any():
            raise InputError(f"a start that was found, {points[outside][0]}, lies outside {self.over.names}")
        return Real2SimUpdated(self.settings, self.over, np.vstack([self.centers, points]))


def found_starts(task: Task, visited: VisitedStates) -> QuestionResult:
    """Estimates of how episodes began, those within the starts' bounds; of a parameter that does not vary
    between starts nothing is taken over.
    """
    space = starts_of(task)
    names = [f"start/{spec.name}" for spec in task.parameters()]
    points = visited.values[visited.step == 0][:, [names.index(name) for name in space.names]]
    points = points[((points >= space.lower) & (points <= space.upper)).all(axis=1)]
    return QuestionResult(Question(points, np.zeros(len(points), dtype=np.int64)), np.ones(len(points)))
