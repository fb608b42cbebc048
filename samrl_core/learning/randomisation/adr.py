"""Automatic domain randomisation: a box that grows where the actor still succeeds (Akkaya et al. 2019).

"Solving Rubik's Cube with a Robot Hand": a boundary of one dimension is tried with all others sampled; when
enough episodes were tried there, it moves out if they did well, and in if they did badly. How hard the
training is, is measured by the box's entropy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.distributions import UniformBox
from samrl_core.learning.randomisation.space import Space
from samrl_core.learning.randomisation.strategy import Measure, Question, QuestionResult


@dataclass(frozen=True)
class AdrSettings:
    """Thresholds and steps. ASSUMPTIONS, but for the scheme.

    Raises:
        InputError: thresholds that are not ordered, or a number outside its meaning.
    """

    low: float = 0.5  # success at a boundary up to which it moves in, 0..1
    high: float = 0.8  # success from which it moves out, 0..1
    buffer: int = 8  # episodes at a boundary before it is moved
    step: float = 0.1  # by which a boundary moves [width of the space's bounds]
    begin: float = 0.1  # width of the box at first, about the nominal values [width of the space's bounds]
    episodes: int = 128  # tried per question
    questions: int = 4  # asked of each actor

    def __post_init__(self) -> None:
        if not 0.0 <= self.low < self.high <= 1.0:
            raise InputError(f"low {self.low} must be below high {self.high}, both within 0..1")
        if not (0.0 < self.step <= 1.0 and 0.0 < self.begin <= 1.0):
            raise InputError(f"step {self.step} and begin {self.begin} must be above 0 and at most 1")
        if min(self.buffer, self.episodes, self.questions) < 1:
            raise InputError(
                f"buffer {self.buffer}, episodes {self.episodes} and questions {self.questions} must be at "
                f"least 1"
            )


@dataclass(frozen=True, eq=False)
class Adr:
    """Where the boundaries are, and what was tried at each since it moved last."""

    settings: AdrSettings
    distribution: UniformBox
    tried: tuple[tuple[float, ...], ...]  # (2 P) results at each lower, then each upper boundary
    measure: Measure = "success"

    @staticmethod
    def begin(space: Space, settings: AdrSettings | None = None) -> Adr:
        """A narrow box about the nominal values."""
        s = settings or AdrSettings()
        lower, upper = _least(space, s)
        return Adr(s, UniformBox(space, lower, upper), ((),) * (2 * len(space)))

    def ask(self, rng: np.random.Generator) -> Question:
        """See `Strategy`: each point on one boundary, all equally likely; the other numbers are sampled."""
        box, count = self.distribution, self.settings.episodes
        points = box.sample(rng, count)
        label = rng.integers(2 * len(box.space), size=count)
        for row, k in enumerate(label):
            points[row, k % len(box.space)] = self._boundary(int(k))
        return Question(points, label.astype(np.int64))

    def update(self, evidence: QuestionResult) -> Adr:
        """See `Strategy`; evidence counts in order.

        Raises:
            InputError: a result that is no success rate, or a label that is no boundary.
        """
        found = self
        for point, label, result in zip(
            evidence.question.points, evidence.question.label, evidence.result, strict=True
        ):
            if not (0 <= label < len(self.tried) and 0.0 <= result <= 1.0):
                raise InputError(
                    f"success {result} at boundary {label}: must be within 0..1 and below {len(self.tried)}"
                )
            # A boundary that has moved since the question was asked was not tried by it.
            if point[label % len(found.distribution.space)] == found._boundary(int(label)):
                found = found._with(int(label), float(result))
        return found

    def _boundary(self, k: int) -> float:
        size = len(self.distribution.space)
        return float((self.distribution.lower if k < size else self.distribution.upper)[k % size])

    def _with(self, k: int, result: float) -> Adr:
        """One result more; the boundary moves when they are enough."""
        s, tried = self.settings, list(self.tried)
        tried[k] = (*tried[k], result)
        if len(tried[k]) < s.buffer:
            return replace(self, tried=tuple(tried))
        success = float(np.mean(tried[k]))
        tried[k] = ()
        outwards = (success >= s.high) - (success <= s.low)
        return replace(self, tried=tuple(tried), distribution=self._moved(k, outwards))

    def _moved(self, k: int, outwards: int) -> UniformBox:
        """Within the space's bounds, and never within the box that was begun with."""
        space = self.distribution.space
        lower, upper = self.distribution.lower.copy(), self.distribution.upper.copy()
        i, by = k % len(space), outwards * self.settings.step * (space.upper - space.lower)
        least = _least(space, self.settings)
        if k < len(space):
            lower[i] = np.clip(lower[i] - by[i], space.lower[i], least[0][i])
        else:
            upper[i] = np.clip(upper[i] + by[i], least[1][i], space.upper[i])
        return UniformBox(space, lower, upper)


def _least(space: Space, s: AdrSettings) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the narrowest box: about the nominal values, or beside them at the space's edge."""
    half = 0.5 * s.begin * (space.upper - space.lower)
    lower = np.clip(space.nominal - half, space.lower, space.upper - 2.0 * half)
    return lower, np.minimum(lower + 2.0 * half, space.upper)
