"""One training of a residual, from before the first real step on: rounds of episodes, and updates in between.

A round's episodes are played with the same weights, side by side where there are processes for it; then the
learner makes its updates. What an episode draws depends on the run's seed and its number alone, so the result
does not depend on how many processes there are. Weights, optimisers and replay are on the disk after every
round: a run that was stopped goes on at the last whole one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.errors import InputError, SolveError
from samrl_core.experiments.residual_episodes import Order, Place, Play, Played
from samrl_core.learn.checkpoint import load_checkpoint, save_checkpoint
from samrl_core.learn.networks import Encoder
from samrl_core.learn.replay import End, Replay, ReplayInfo
from samrl_core.learn.residual import ResidualLearner, ResidualSettings
from samrl_core.learn.residual_training import STOPPED
from samrl_core.learn.step_features import StepFeatures, fingerprint
from samrl_core.learn.transitions import transitions_of
from samrl_core.learn.weights import WeightsInfo, save_weights
from samrl_core.robots.robot import CellSpec

KIND = "residual_run"
_TRAINING, _EVALUATION = 1, 2  # seeds of scenes never meet: these come first in what they are made of


@dataclass(frozen=True)
class RunSettings:
    """How a run goes.

    Raises:
        InputError: a value outside its limits.
    """

    points: tuple[int, ...]  # real steps at which is evaluated; the last one ends the run
    learner: ResidualSettings = ResidualSettings()
    episodes: int = 4  # per round, at least
    growth: float = 0.25  # more of them, up to this share of all before: they are played side by side
    first_steps: int = 200  # in the replay before the first update
    updates_per_step: float = 2.0  # each step beyond the first ones allows so many
    # Small and steady: 1.5 mm that change within an episode keep the tool from where the nominal policy goes
    # on from, so that nothing succeeds, and there is no reward to learn from.
    exploration: float = 0.0005  # standard deviation per axis of what is tried [m]
    memory: float = 0.98  # of the exploration from action to action
    evaluated: int = 20  # episodes per evaluation
    max_actions: int = 40  # of an episode

    def __post_init__(self) -> None:
        if not self.points or list(self.points) != sorted(set(self.points)) or self.points[0] < 0:
            raise InputError(f"evaluation points {self.points} must grow from 0 or more")
        for name in ("episodes", "first_steps", "evaluated", "max_actions"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1")
        if not 0.0 <= self.growth < np.inf:
            raise InputError(f"growth is {self.growth}, must be at least 0 and finite")
        if not (self.updates_per_step > 0 and self.exploration > 0 and 0 <= self.memory <= 1):
            raise InputError(
                f"updates_per_step {self.updates_per_step} and exploration {self.exploration} m must be "
                f"above 0, memory {self.memory} within 0..1"
            )


@dataclass(frozen=True)
class Evaluated:
    """The residual as it is, without exploration; none of it is learnt from."""

    steps: int  # real steps before
    episodes: int  # of the training before
    updates: int
    successes: list[bool]  # by the truth, per episode
    detected: list[bool]  # by the model
    final_errors: list[float]  # [m]
    actions: list[int]
    errors: list[str]  # of episodes that an error ended
    residual: float  # mean length [m]


class ResidualRun:
    """One task, one seed; `advance` up to each point, `evaluate` there.

    Raises:
        InputError: what lies in the folder is corrupt, or was made with other settings.
    """

    def __init__(
        self,
        folder: Path,
        place: Place,
        cell: CellSpec,
        encoder: Encoder,
        seed: int,
        settings: RunSettings,
        play: Play,
        device: str = "cpu",
    ) -> None:
        self._folder, self._place, self._cell, self._seed = folder, place, cell, seed
        self._settings, self._play = settings, play
        self._learner = ResidualLearner(settings.learner, encoder, seed, device)
        # No step is ever written over: the longest run's last round may go beyond its last point.
        capacity = settings.points[-1] + settings.episodes * settings.max_actions
        self._replay = Replay.write(folder / "replay.bin", ReplayInfo(place.task, cell.intrinsics, capacity))
        about = {"place": asdict(place), "seed": seed, "settings": asdict(settings)}
        about["encoder"] = fingerprint(encoder)
        self._about = {name: _plain(value) for name, value in about.items()}
        self._episodes = 0
        self._resume()
        self._features = StepFeatures(self._replay, cell, self._learner.actor.encoder, device)

    @property
    def steps(self) -> int:
        """Real steps so far."""
        return self._replay.last

    def close(self) -> None:
        """Let another process go on with it."""
        self._replay.close()

    def advance(self, steps: int, going: Callable[[], bool] = lambda: True) -> None:
        """Rounds until there are so many real steps, or `going` says no.

        Raises:
            SolveError: a loss or gradient is not finite; the state that led to it is saved as
                `stopped.safetensors`, and the last whole round stays what a run goes on from.
        """
        while self.steps < steps and going():
            self._round(steps)

    def evaluate(self) -> Evaluated:
        """Episodes of this run's own scenes, the same ones at every point."""
        s = self._settings
        plain = [self._order(_EVALUATION, k) for k in range(s.evaluated)]
        played = self._play([replace(order, exploration=0.0) for order in plain])
        lengths = [np.linalg.norm(step.residual) for one in played for step in one.steps]
        return Evaluated(
            self.steps,
            self._episodes,
            self._learner.updates,
            [one.success for one in played],
            [one.ended == "done" for one in played],
            [one.final_error for one in played],
            [len(one.steps) for one in played],
            [one.why for one in played if one.ended == "error"],
            float(np.mean(lengths)) if lengths else 0.0,
        )

    def save_weights(self, path: Path, figures: dict[str, float]) -> None:
        """The residual as a weight file."""
        limit = self._settings.learner.limit
        off = dict(zip(("offset_x", "offset_y", "offset_z"), self._place.offset, strict=True))
        about = {"steps": float(self.steps), "updates": float(self._learner.updates), **off, **figures}
        info = WeightsInfo(
            "residual_actor", self._place.task, self._cell.intrinsics, limit, self._seed, about
        )
        save_weights(path, self._learner.actor, info)

    def _round(self, steps: int) -> None:
        s = self._settings
        first = self._episodes
        fewest = math.ceil((steps - self.steps) / s.max_actions)  # more may go beyond
        count = max(s.episodes, min(int(s.growth * first), fewest))
        played = self._play([self._order(_TRAINING, first + k) for k in range(count)])
        for number, one in enumerate(played, first):
            self._store(number, one)
        self._episodes += count
        self._replay.flush()
        self._train()
        self._save(self._checkpoint)

    def _order(self, kind: int, number: int) -> Order:
        s = self._settings
        state = {} if not self._learner.updates else self._learner.actor.state_dict()
        scene, noise = np.random.SeedSequence([kind, self._seed, number]).generate_state(2) >> 1
        return Order(
            self._place,
            int(scene),
            s.max_actions,
            {name: value.cpu().numpy() for name, value in state.items()},
            s.learner.limit,
            s.exploration,
            s.memory,
            int(noise),
        )

    def _store(self, number: int, played: Played) -> None:
        last = 0
        for step in played.steps:
            last = self._replay.append(replace(step, episode=number))
        if played.end is not End.OPEN and last:
            self._replay.end_episode(last, played.end)

    def _train(self) -> None:
        s, learner = self._settings, self._learner
        transitions = transitions_of(self._replay, s.learner.n_step, s.learner.gamma)
        allowed = s.updates_per_step * (self.steps - s.first_steps)
        self._features.take_in()
        try:
            while len(transitions) and learner.updates < allowed:
                learner.learn(partial(self._features.batch, transitions))
        except SolveError:
            self._save(self._folder / STOPPED)
            raise

    @property
    def _checkpoint(self) -> Path:
        return self._folder / "checkpoint.safetensors"

    def _save(self, path: Path) -> None:
        about = {**self._about, "steps": self.steps, "episodes": self._episodes}
        save_checkpoint(path, KIND, self._learner.state(), about)

    def _resume(self) -> None:
        if not self._checkpoint.exists():
            self._replay.drop_after(0)
            return
        tensors, about = load_checkpoint(self._checkpoint, KIND)
        steps, self._episodes = int(about.pop("steps")), int(about.pop("episodes"))
        if about != self._about:
            different = sorted(k for k in self._about if about.get(k) != self._about[k])
            raise InputError(
                f"{self._checkpoint} was made with another {' and '.join(different)}; take another folder"
            )
        if self._replay.last < steps:
            raise InputError(
                f"{self._checkpoint} has learnt from {steps} steps, {self._replay.path} holds "
                f"{self._replay.last}; put the replay back, or remove both to begin anew"
            )
        self._replay.drop_after(steps)  # of a round that was not finished: it is played again
        self._learner.load_state(tensors)


def _plain(value: Any) -> Any:
    """As JSON gives it back."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return str(value) if isinstance(value, Path) else value
