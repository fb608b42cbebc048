"""Distribution of a training's starts, appearances and physical parameters, and the strategy that adapts it.

Results are cached question by question in the training's folder: a resumed one asks again, finds the results
there, and comes to the same distribution.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.streams import stream
from samrl_core.learning.images.appearance import AppearanceSettings, AppearanceSource
from samrl_core.learning.randomisation.choose import begin
from samrl_core.learning.randomisation.discrepancy import Discrepancy
from samrl_core.learning.randomisation.distributions import ParameterDistribution
from samrl_core.learning.randomisation.found import Real2SimUpdated
from samrl_core.learning.randomisation.of_task import APPEARANCE, AppearancesOf, alike
from samrl_core.learning.randomisation.strategy import REAL2SIM, Question, QuestionResult
from samrl_core.learning.sim.episodes import EpisodeGroup, run_cached_groups
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.learning.states.visited import VisitedStates
from samrl_core.model.model import Model
from samrl_core.policy.networks.networks import SimActor

Log = Callable[[str, dict[str, float]], None]
Answer = Callable[[Question], np.ndarray]
_STAGE = "randomisation"
_NAMES = ("points", "label", "result")


class Randomising:
    """The strategy of one training."""

    def __init__(
        self,
        model: Model,
        settings: TrainSettings,
        folder: Path,
        visited: VisitedStates | None,
        log: Log,
        given_actor: bool = False,
        correction: CellCorrection = NO_CORRECTION,
    ) -> None:
        """Begins the strategy; `given_actor`: the training starts from a given actor.

        `correction` is of a cell; images show it wrong by what its covariance leaves.

        Raises:
            InputError: as `choose.begin`, a strategy that learns from actors in a training of one, or a
                correction for an actor that sees the model's images.
        """
        s = settings
        if correction.covariance.of and s.randomisation == REAL2SIM:
            raise InputError(
                f"an actor of {REAL2SIM!r} sees the model's images, in which a calibration is never wrong; "
                f"leave the correction out, or ask for randomisation 'uniform'"
            )
        self.correction = correction
        self._model, self._settings, self._folder, self._log = model, s, folder / _STAGE, log
        self._strategy = begin(s.randomisation, model, visited, s.adr, s.simopt, s.found)
        if self._strategy.measure == "success" and (s.rounds == 0 or given_actor):
            raise InputError(
                f"{s.randomisation!r} learns between rounds; ask for 1 at least, better 4, and hand in no "
                f"actor"
            )
        self._visited = visited
        self._entropies = [self._strategy.distribution.entropy()]
        self._asked = 0

    @property
    def distribution(self) -> ParameterDistribution | None:
        """The present distribution; None where all is as the task and `AppearanceSettings` declare it."""
        s = self._strategy
        if isinstance(s, Real2SimUpdated) and not len(s.centers):
            return None
        return s.distribution

    @property
    def appearances(self) -> AppearanceSource:
        """Of images."""
        found = self.distribution
        return (
            AppearanceSettings()
            if found is None or not found.space.columns(APPEARANCE)
            else AppearancesOf(found)
        )

    def before_training(self) -> None:
        """All that the strategy can learn without an actor."""
        if self._strategy.measure != "discrepancy" or self._visited is None:
            return
        measure = Discrepancy(self._model.task, self._model.dynamics, self._visited)
        space = self._strategy.distribution.space
        while self._ask(lambda question: measure.at(space, question.points)):
            pass

    def after_actor(self, actor: SimActor) -> None:
        """What the strategy learns from how well an actor does."""
        if self._strategy.measure == "success":
            for _ in range(self._settings.adr.questions):
                self._ask(lambda question: self._successes(actor, question))

    def summary(self) -> dict[str, Any]:
        """What came of it, as plain values."""
        found = self.distribution
        return {
            "strategy": self._settings.randomisation,
            "questions": self._asked,
            "entropy": self._entropies,
            "distribution": None if found is None else found.record(),
        }

    def _ask(self, answer: Answer) -> bool:
        """One question, answered now or before; False when the strategy has none."""
        s, number = self._settings, self._asked
        question = self._strategy.ask(stream(s.seed, _STAGE, number))
        if not len(question):
            return False
        path = self._folder / f"evidence-{number:03d}.npz"
        if not path.exists():
            arrays = {"points": question.points, "label": question.label, "result": answer(question)}
            write_arrays(path, arrays)
        rows = read_arrays(path, _NAMES)
        if not np.array_equal(rows["points"], question.points):
            raise InputError(f"{path} answers another question; remove it, and it is answered anew")
        self._strategy = self._strategy.update(QuestionResult(question, rows["result"]))
        self._asked += 1
        self._entropies.append(self._strategy.distribution.entropy())
        self._log(
            _STAGE,
            {"questions": self._asked, "mean": float(rows["result"].mean()), "entropy": self._entropies[-1]},
        )
        return True

    def _successes(self, actor: SimActor, question: Question) -> np.ndarray:
        """Whether the actor succeeds at each point, with a new view for every action."""
        s, distribution = self._settings, self._strategy.distribution
        rows = [
            few
            for same in alike(distribution.space, question.points)
            for few in np.array_split(same, -(-len(same) // s.group))
        ]
        groups = [
            EpisodeGroup(
                s.seed,
                (_STAGE, self._asked, "episodes", k),
                len(few),
                hold=False,
                action_noise=0.0,
                noisy=True,
                max_actions=s.max_actions,
                distribution=distribution,
                points=question.points[few],
                cell=s.cell,
                correction=self.correction,
            )
            for k, few in enumerate(rows)
        ]
        found = run_cached_groups(
            self._model.task.name,
            actor,
            groups,
            ("success",),
            self._folder / f"question-{self._asked:03d}",
            s.device,
            s.workers,
            lambda row: self._log(_STAGE, row),
        )
        result = np.zeros(len(question))
        for which, part in zip(rows, found, strict=True):
            result[which] = part["success"]
        return result
