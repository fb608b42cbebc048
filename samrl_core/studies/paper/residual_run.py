"""One training of a residual, from before the first real step on: rounds of episodes, and updates in between.

A round's episodes are played with the same weights, side by side where there are processes for it; then the
learner makes its updates. What an episode samples depends on the run's seed and its number alone, so the
result does not depend on how many processes there are. Weights, optimisers and replay are on the disk after
every
round: a run that was stopped goes on at the last whole one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from samrl_core.cell.robots.cells import DEFAULT_CELL
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError, SolveError
from samrl_core.learning.data.checkpoint import load_checkpoint, save_checkpoint
from samrl_core.learning.data.fit import STOPPED
from samrl_core.learning.residual.learners import create_learner, settings_to_json, update_names
from samrl_core.learning.residual.replay import End, Replay, ReplayInfo
from samrl_core.learning.residual.transitions import StepFeatures, encoder_sha256, transitions_of
from samrl_core.policy.networks.networks import Encoder, ResidualActor
from samrl_core.policy.networks.weights import WeightsInfo, save_weights
from samrl_core.studies.episodes.residual_episodes import EpisodeSite, Play, Played
from samrl_core.studies.paper.residual_evaluation import TRAINING, RunSettings, order_of, weights_of

KIND = "residual_run"


class ResidualRun:
    """One task, one seed; `advance` up to each point, `save_weights` there; `evaluated_file` evaluates them.

    Raises:
        InputError: what lies in the folder is corrupt, or was made with other settings.
    """

    def __init__(
        self,
        folder: Path,
        site: EpisodeSite,
        cell: CellSpec,
        encoder: Encoder,
        seed: int,
        settings: RunSettings,
        play: Play,
        device: str = "cpu",
    ) -> None:
        self._folder, self._site, self._cell, self._seed = folder, site, cell, seed
        self._settings, self._play = settings, play
        self._learner = create_learner(settings.learner, encoder, seed, device)
        # No step is ever written over: the longest run's last round may go beyond its last point.
        capacity = settings.points[-1] + settings.episodes * settings.max_actions
        self._replay = Replay.write(folder / "replay.bin", ReplayInfo(site.task, cell.intrinsics, capacity))
        described = {**asdict(settings), "learner": settings_to_json(settings.learner)}
        defaults = {("cell", DEFAULT_CELL), ("instance", "")}  # left out, as runs before there were such did
        where = {key: value for key, value in asdict(site).items() if (key, value) not in defaults}
        about = {"place": where, "seed": seed, "settings": described}
        about["encoder"] = encoder_sha256(encoder)
        self._about = {name: _plain(value) for name, value in about.items()}
        self._episodes = 0
        self._resume()
        self._features = StepFeatures(self._replay, cell, self._learner.actor.encoder, device)

    @property
    def actor(self) -> ResidualActor:
        """What is being trained."""
        return self._learner.actor

    @property
    def updates(self) -> int:
        """Of the learner so far."""
        return self._learner.updates

    @property
    def steps(self) -> int:
        """Real steps so far."""
        return self._replay.last

    def close(self) -> None:
        """Let another process go on with it."""
        self._replay.close()

    def advance(self, steps: int, going: Callable[[], bool] = lambda: True) -> None:
        """Rounds until there are so many real steps, or `going` returns False.

        Raises:
            SolveError: a loss or gradient is not finite; the state that led to it is saved as
                `stopped.safetensors`, and the last whole round stays what a run goes on from.
        """
        while self.steps < steps and going():
            self._round(steps)

    def save_weights(self, path: Path) -> None:
        """The residual as a weight file."""
        limit = self._settings.learner.limit
        off = dict(zip(("offset_x", "offset_y", "offset_z"), self._site.offset, strict=True))
        counts = {"steps": self.steps, "episodes": self._episodes, "updates": self._learner.updates}
        metrics = {name: float(count) for name, count in counts.items()} | off
        info = WeightsInfo(
            "residual_actor", self._site.task, self._cell.intrinsics, limit, self._seed, metrics
        )
        save_weights(path, self._learner.actor, info)

    def _round(self, steps: int) -> None:
        s = self._settings
        first = self._episodes
        fewest = math.ceil((steps - self.steps) / s.max_actions)  # more may go beyond
        count = max(s.episodes, min(int(s.growth * first), fewest))
        weights = weights_of(self._learner.actor, self._learner.updates)
        played = self._play(
            [
                order_of(TRAINING, first + k, self._site, self._seed, self._settings, weights)
                for k in range(count)
            ]
        )
        for number, one in enumerate(played, first):
            self._store(number, one)
        self._episodes += count
        self._replay.flush()
        self._train()
        self._save(self._checkpoint)

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
        self._features.add_new()
        try:
            while len(transitions) and learner.updates < allowed:
                learner.update(partial(self._features.sample_batch, transitions))
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
        if isinstance(about.get("settings"), dict):
            about["settings"]["learner"] = update_names(about["settings"].get("learner", {}))
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
