"""Learn@Sim from nothing to weights: states, actor, its own states, episodes, sensing-aware Q.

Each stage leaves files in the training's folder, part by part; what is there is not made again, so a
training that was killed goes on where it was.

    train.json        what is trained, and with which settings
    randomisation/    what a strategy asked and what came out, question by question
    states/           labelled states (eqs. 18-22)
    actor-0/ ...      regression on them (eq. 23), one folder per round
    round-0/ ...      episodes of the actor, the states that it visited, labelled
    episodes/         actions, views and returns of the last actor
    q/                regression on what actions are worth, or on the returns (eq. 24), see `q_target`
    judged/           the last actor's success
    TASK_sim_actor.safetensors, TASK_sensing_q.safetensors, summary.json
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection, as_data
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.common.files import folder_lock, keep_to, write_whole
from samrl_core.learning.data.fit import ACTION, Progress, RegressionSamples
from samrl_core.learning.images.acted_samples import ActedSamples
from samrl_core.learning.images.batch_render import BatchRenderer
from samrl_core.learning.images.cached_samples import CachedSamples
from samrl_core.learning.images.rendered_samples import RenderedSamples, SampleSettings, Scenes
from samrl_core.learning.randomisation.strategy import REAL2SIM
from samrl_core.learning.sim.actor_episodes import ActorEpisodes
from samrl_core.learning.sim.prepare import prepare_states
from samrl_core.learning.sim.randomising import Randomising
from samrl_core.learning.sim.regressions import fit_actor, fit_q
from samrl_core.learning.sim.sample_states import StateSource
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.learning.states.states import StateSamples
from samrl_core.learning.states.visited import VisitedStates, load_visited
from samrl_core.model.model import Model
from samrl_core.policy.networks.networks import SensingQ, SimActor
from samrl_core.policy.networks.weights import (
    WeightsInfo,
    load_weights,
    save_weights,
    sha256_of,
    weights_name,
)

Log = Callable[[str, dict[str, float]], None]  # stage, its metrics so far
CONFIG, SUMMARY = "train.json", "summary.json"


def train(
    task: str,
    folder: Path,
    settings: TrainSettings,
    log: Log = lambda stage, row: None,
    given: Path | None = None,
    visited: Sequence[Path] = (),
    correction: CellCorrection = NO_CORRECTION,
) -> dict[str, Any]:
    """All stages that are left; the summary, which is in the folder too.

    Args:
        task: name of the task.
        folder: of this training alone; made if it is missing.
        settings: sizes and seeds. Device and workers may differ when a training goes on.
        log: called as each stage gets on.
        given: weights of an actor; only its Q is then trained, and the actor is evaluated.
        visited: files of states that Real2Sim found in the cell: where some episodes begin (lines 16-17 of
            Algorithm 1), or what SimOpt compares the model with.
        correction: of the cell that is trained for; images show it wrong by what its covariance leaves.

    Raises:
        InputError: the given actor or a file of visited states does not fit; the folder holds a training of
            another task or with other settings, or what is in it is damaged; or another process is training
            there.
        SolveError: a loss or gradient is not finite; the state before it is in the folder.
    """
    with folder_lock(folder):
        return _Training(task, folder, settings, log, given, visited, correction).run()


class _Training:
    def __init__(
        self,
        task: str,
        folder: Path,
        settings: TrainSettings,
        log: Log,
        given: Path | None,
        visited: Sequence[Path],
        correction: CellCorrection,
    ) -> None:
        self.task, self.folder, self.settings, self.log = task_named(task), folder, settings, log
        cell = cell_named(settings.cell)
        self.given = None if given is None else load_weights(given, "sim_actor", task, cell)
        parts = [load_visited(path, task) for path in visited]
        visited_states = VisitedStates.joined(parts) if parts else None
        self.starts = (
            visited_states.starts(self.task)
            if visited_states and settings.randomisation == REAL2SIM
            else None
        )
        self.model = Model(self.task, cell)
        self.randomising = Randomising(
            self.model, settings, folder, visited_states, log, given is not None, correction
        )
        self._check_folder("" if given is None else sha256_of(given), [sha256_of(path) for path in visited])
        self.renderer = BatchRenderer(self.model, settings.device)
        self.episodes = ActorEpisodes(self.task.name, folder, settings, self.randomising, log)

    def run(self) -> dict[str, Any]:
        self.randomising.before_training()
        actor, metrics = self._learned_actor() if self.given is None else self._given_actor(*self.given)
        self._save(actor, metrics)
        q, q_metrics = self._q(actor)
        self._save(q, q_metrics)
        success = self.episodes.evaluate(actor)
        summary = {"schema": 1, "task": self.task.name, "actor": metrics, "q": q_metrics, "success": success}
        summary["randomisation"] = self.randomising.summary()
        write_whole(self.folder / SUMMARY, (json.dumps(summary, indent=1) + "\n").encode())
        return summary

    def _given_actor(self, actor: nn.Module, info: WeightsInfo) -> tuple[SimActor, dict[str, float]]:
        assert isinstance(actor, SimActor)
        return actor.to(self.settings.device), info.figures

    def _learned_actor(self) -> tuple[SimActor, dict[str, float]]:
        s = self.settings
        states = prepare_states(
            self.task.name,
            s.states,
            self.folder / "states",
            s.seed,
            s.workers,
            StateSource(s.explore, self.starts, None if self.starts else self.randomising.distribution),
            progress=lambda done, wanted: self.log("states", {"done": done, "of": wanted}),
            cell=s.cell,
        )
        known, held_out = _split(states, s.validation)
        parts = [Scenes.of_states(known)]
        validation = self._samples(Scenes.of_states(held_out), 1)
        actor, metrics = self._actor(0, parts, validation)
        for k in range(s.rounds):
            self.randomising.after_actor(actor)
            parts.append(self.episodes.round(k, actor))
            actor, metrics = self._actor(k + 1, parts, validation)
        return actor, metrics

    def _check_folder(self, given: str, visited: list[str]) -> None:
        """Writes down settings and commit of a new training; one that goes on must have the same settings."""
        config = asdict(replace(self.settings, device="", workers=0))
        for part in ("actor", "q"):  # where it is computed, and how precisely, may change on the way
            config[part] |= {"device": "", "bfloat16": False}
        config |= {"schema": 1, "task": self.task.name, "given_actor": given, "visited": visited}
        config["correction"] = json.dumps(as_data(self.randomising.correction))  # one text
        note = {"commit": _commit()}
        before = {"cell": DEFAULT_CELL, "correction": json.dumps(as_data(NO_CORRECTION))}
        kept = keep_to(self.folder / CONFIG, config, "training", note, before)
        self.commit = kept["commit"]

    def _samples(self, scenes: Scenes, stream: int) -> RenderedSamples:
        randomising = self.randomising
        settings = SampleSettings(appearances=randomising.appearances, correction=randomising.correction)
        return RenderedSamples(scenes, self.renderer, 10 * self.settings.seed + stream, settings)

    def _training_samples(self, scenes: Scenes, stream: int, stage: str) -> RegressionSamples:
        """Training images, cached if the settings ask for it; validation images are always rendered anew."""
        samples, s = self._samples(scenes, stream), self.settings
        if not s.kept:
            return samples
        return CachedSamples(
            samples,
            s.kept,
            torch.device(s.device),
            lambda done, wanted: self.log(stage, {"rendered": done, "of": wanted}),
        )

    def _fit_progress(self, stage: str) -> Progress:
        return lambda row: self.log(stage, row)

    def _actor(
        self, k: int, parts: list[Scenes], validation: RenderedSamples
    ) -> tuple[SimActor, dict[str, float]]:
        s, stage = self.settings, f"actor-{k}"
        fit = replace(s.actor, seed=s.seed, device=s.device)
        scenes = self._training_samples(_joined(parts), 0, stage)
        limit = self.task.action_limit
        actor, result = fit_actor(
            scenes, validation, limit, fit, self.folder / stage, self._fit_progress(stage)
        )
        return actor, result.figures

    def _q(self, actor: SimActor) -> tuple[SensingQ, dict[str, float]]:
        s, groups = self.settings, self.episodes.for_q(actor)
        held_out = max(1, round(s.validation * len(groups) / s.levels)) * s.levels  # each level of noise
        parts = (groups[:-held_out], groups[-held_out:])
        if s.q_target == "return":
            train = self._training_samples(_of_returns(parts[0]), 3, "q")
            validation: RegressionSamples = self._samples(_of_returns(parts[1]), 4)
        else:
            images = self._training_samples(self.episodes.labelled("q", parts[0]), 3, "q")
            train = ActedSamples(images, actor, 10 * s.seed + 3, s.acted)
            checked = self._samples(self.episodes.labelled("check", parts[1]), 4)
            validation = ActedSamples(checked, actor, 10 * s.seed + 4, s.acted)
        fit = replace(s.q, seed=s.seed, device=s.device)
        q, result = fit_q(train, validation, fit, self.folder / "q", self._fit_progress("q"), s.q_loss)
        return q, result.figures

    def _save(self, network: SimActor | SensingQ, metrics: dict[str, float]) -> None:
        kind = "sim_actor" if isinstance(network, SimActor) else "sensing_q"
        lens, limit = self.model.cell.intrinsics, self.task.action_limit
        info = WeightsInfo(kind, self.task.name, lens, limit, self.settings.seed, metrics, self.commit)
        save_weights(self.folder / weights_name(self.task.name, kind), network, info)


def _split(states: StateSamples, share: float) -> tuple[StateSamples, StateSamples]:
    """By order: neighbours are of the same episodes, a random split would validate on training episodes."""
    kept = round((1.0 - share) * len(states))
    return states.rows(slice(0, kept)), states.rows(slice(kept, None))


def _joined(parts: list[Scenes]) -> Scenes:
    frames, tips = (np.concatenate([getattr(p, name) for p in parts]) for name in ("frames", "tip_in_base"))
    return Scenes(frames, tips, {ACTION: np.concatenate([p.targets[ACTION] for p in parts])})


def _of_returns(groups: list[dict[str, np.ndarray]]) -> Scenes:
    return Scenes.of_returns({name: np.concatenate([g[name] for g in groups]) for name in groups[0]})


def _commit() -> str:
    """Of the source tree that trains, empty outside one."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
