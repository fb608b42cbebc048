"""Learn@Sim from nothing to weights: states, actor, its own states, episodes, sensing-aware Q.

Each stage leaves files in the training's folder, part by part; what is there is not made again, so a
training that was killed goes on where it was.

    train.json        what is trained, and with which settings
    randomisation/    what a strategy asked and what came out, question by question
    states/           labelled states (eqs. 18-22)
    actor-0/ ...      regression on them (eq. 23), one folder per round
    round-0/ ...      episodes of the actor, the states that it came to, labelled
    episodes/         actions, views and returns of the last actor
    q/                regression on the returns (eq. 24)
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

from samrl_core.errors import InputError
from samrl_core.folder_lock import folder_lock
from samrl_core.learn.acted_samples import ActedSamples
from samrl_core.learn.array_files import read_arrays, write_arrays
from samrl_core.learn.batch_render import BatchRenderer
from samrl_core.learn.episodes import Group
from samrl_core.learn.fit import Progress
from samrl_core.learn.imitation import fit_actor
from samrl_core.learn.kept_groups import kept_groups
from samrl_core.learn.kept_samples import KeptSamples
from samrl_core.learn.networks import SensingQ, SimActor
from samrl_core.learn.prepare import label_all, prepare_states
from samrl_core.learn.randomisation.names import REAL2SIM
from samrl_core.learn.randomising import Randomising
from samrl_core.learn.rendered_samples import DrawSettings, RenderedSamples, Scenes
from samrl_core.learn.rollouts import PER_ACTION
from samrl_core.learn.samples import ACTION, Samples
from samrl_core.learn.states import StateSamples
from samrl_core.learn.train_settings import TrainSettings
from samrl_core.learn.value import fit_q
from samrl_core.learn.visited import VisitedStates, load_visited
from samrl_core.learn.weights import WeightsInfo, load_weights, save_weights, sha256_of
from samrl_core.model.model import Model
from samrl_core.robots.cell import default_cell
from samrl_core.tasks import task_named
from samrl_core.whole_file import write_whole

Tell = Callable[[str, dict[str, float]], None]  # stage, its figures so far
CONFIG, SUMMARY = "train.json", "summary.json"
_LABELLED = ("values", "tip_in_base", "frames", "action")  # of a round
_SEEN = ("values", "tip_in_base", "frames", "success")  # of its episodes
_JUDGED = ("success", "actions")
_TAKEN = (*PER_ACTION, "success")  # of Q's episodes
_STREAMS = {"round": 1, "episodes": 2, "judged": 3}  # one source of randomness each, besides the states'


def train(
    task: str,
    folder: Path,
    settings: TrainSettings,
    tell: Tell = lambda stage, row: None,
    given: Path | None = None,
    visited: Sequence[Path] = (),
) -> dict[str, Any]:
    """All stages that are left; the summary, which is in the folder too.

    Args:
        task: name of the task.
        folder: of this training alone; made if it is missing.
        settings: sizes and seeds. Device and workers may differ when a training goes on.
        tell: called as each stage gets on.
        given: weights of an actor; only its Q is then trained, and it is judged.
        visited: files of states that Real2Sim found in the cell: where some episodes begin (lines 16-17 of
            Algorithm 1), or what SimOpt compares the model with.

    Raises:
        InputError: the given actor or a file of visited states does not fit; the folder holds a training of
            another task or with other settings, or what is in it is damaged; or another process is training
            there.
        SolveError: a loss or gradient is not finite; the state before it is in the folder.
    """
    with folder_lock(folder):
        return _Training(task, folder, settings, tell, given, visited).run()


class _Training:
    def __init__(
        self,
        task: str,
        folder: Path,
        settings: TrainSettings,
        tell: Tell,
        given: Path | None,
        visited: Sequence[Path],
    ) -> None:
        self.task, self.folder, self.settings, self.tell = task_named(task), folder, settings, tell
        self.given = None if given is None else load_weights(given, "sim_actor", task, default_cell())
        parts = [load_visited(path, task) for path in visited]
        seen = VisitedStates.joined(parts) if parts else None
        self.starts = seen.starts(self.task) if seen and settings.randomisation == REAL2SIM else None
        self.model = Model(self.task, default_cell())
        self.randomising = Randomising(self.model, settings, folder, seen, tell, given is not None)
        self._check_folder("" if given is None else sha256_of(given), [sha256_of(path) for path in visited])
        self.renderer = BatchRenderer(self.model, settings.device)

    def run(self) -> dict[str, Any]:
        self.randomising.before_training()
        actor, figures = self._learned_actor() if self.given is None else self._given_actor(*self.given)
        self._keep(actor, figures)
        q, q_figures = self._q(self._episodes(actor), actor)
        self._keep(q, q_figures)
        judged = self._judged(actor)
        summary = {"schema": 1, "task": self.task.name, "actor": figures, "q": q_figures, "success": judged}
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
            s.explore,
            self.starts,
            progress=lambda done, wanted: self.tell("states", {"done": done, "of": wanted}),
            drawn=None if self.starts else self.randomising.distribution,
        )
        known, looked_at = _split(states, s.validation)
        parts = [Scenes.of_states(known)]
        validation = self._samples(Scenes.of_states(looked_at), 1)
        actor, figures = self._actor(0, parts, validation)
        for k in range(s.rounds):
            self.randomising.after_actor(actor)
            parts.append(self._round(k, actor))
            actor, figures = self._actor(k + 1, parts, validation)
        return actor, figures

    def _check_folder(self, given: str, visited: list[str]) -> None:
        """Writes down settings and commit of a new training; one that goes on must have the same settings."""
        config = asdict(replace(self.settings, device="", workers=0))
        for part in ("actor", "q"):  # where it is computed, and how precisely, may change on the way
            config[part] |= {"device": "", "bfloat16": False}
        config |= {"schema": 1, "task": self.task.name, "given_actor": given, "visited": visited}
        wanted = _flat(json.loads(json.dumps(config)))
        path = self.folder / CONFIG
        if not path.exists():
            self.commit = _commit()
            write_whole(path, json.dumps({"commit": self.commit, **wanted}, indent=1) + "\n")
            return
        try:
            found = dict(json.loads(path.read_text()))
        except (ValueError, TypeError) as error:
            raise InputError(f"{path} cannot be read ({error}); take another folder") from error
        self.commit = str(found.pop("commit", ""))
        different = [k for k in {**wanted, **found} if wanted.get(k) != found.get(k)]
        if different:
            listed = ", ".join(f"{k} {found.get(k)!r} (asked for: {wanted.get(k)!r})" for k in different)
            raise InputError(
                f"{self.folder} holds another training: {listed}; take another folder, or ask for the same "
                f"to go on"
            )

    def _samples(self, scenes: Scenes, stream: int) -> RenderedSamples:
        settings = DrawSettings(looks=self.randomising.looks)
        return RenderedSamples(scenes, self.renderer, 10 * self.settings.seed + stream, settings)

    def _to_learn_from(self, scenes: Scenes, stream: int, stage: str) -> Samples:
        """What a regression sees many times over; what validates is drawn anew each time."""
        samples, s = self._samples(scenes, stream), self.settings
        if not s.kept:
            return samples
        return KeptSamples(
            samples,
            s.kept,
            torch.device(s.device),
            lambda done, wanted: self.tell(stage, {"drawn": done, "of": wanted}),
        )

    def _fit_progress(self, stage: str) -> Progress:
        return lambda row: self.tell(stage, row)

    def _actor(
        self, k: int, parts: list[Scenes], validation: RenderedSamples
    ) -> tuple[SimActor, dict[str, float]]:
        s, stage = self.settings, f"actor-{k}"
        fit = replace(s.actor, seed=s.seed, device=s.device)
        scenes = self._to_learn_from(_joined(parts), 0, stage)
        limit = self.task.action_limit
        actor, result = fit_actor(
            scenes, validation, limit, fit, self.folder / stage, self._fit_progress(stage)
        )
        return actor, result.figures

    def _round(self, k: int, actor: SimActor) -> Scenes:
        """States that the actor comes to, with the optimiser's action there."""
        path = self.folder / f"round-{k}" / "labelled.npz"
        if not path.exists():
            self._make_round(k, actor, path)
        rows = read_arrays(path, _LABELLED)
        return Scenes(rows["frames"], rows["tip_in_base"], {ACTION: rows["action"]})

    def _make_round(self, k: int, actor: SimActor, path: Path) -> None:
        s, stage = self.settings, f"round-{k}"
        half = s.round_episodes // 2
        groups = [
            self._group((_STREAMS["round"], k, number, int(hold)), size, hold, 0.0, noisy=True)
            for hold in (True, False)
            for number, size in enumerate(self._sizes(max(1, half)))
        ]
        seen = self._run(actor, groups, _SEEN, path.parent / "episodes", stage)
        values, tips, frames = (
            np.concatenate([one[name] for one in seen]) for name in ("values", "tip_in_base", "frames")
        )
        rows = {"values": values, "tip_in_base": tips, "frames": frames}
        self._label(rows, (_STREAMS["round"], k), path.parent / "labels", path, stage)

    def _label(
        self, rows: dict[str, np.ndarray], stream: tuple[int, ...], folder: Path, path: Path, stage: str
    ) -> None:
        """Writes states with the optimiser's action there, no more of them than states were drawn.

        Episodes that got stuck fill the rows with the same places, so that more of them teach nothing.
        """
        s = self.settings
        count = len(rows["values"])
        rng = np.random.default_rng([s.seed, *stream])
        which = np.sort(rng.choice(count, min(count, s.states), replace=False))
        chosen = {name: array[which] for name, array in rows.items()}
        action, left = label_all(
            self.task.name,
            chosen["values"],
            chosen["tip_in_base"],
            folder,
            s.workers,
            lambda done, wanted: self.tell(stage, {"labelled": done, "of": wanted}),
        )
        write_arrays(path, {name: array[left] for name, array in {**chosen, "action": action}.items()})

    def _episodes(self, actor: SimActor) -> list[dict[str, np.ndarray]]:
        """For Q: with more and more noise on the actions, so that it also sees bad ones; views are held."""
        s = self.settings
        groups = [
            self._group(
                (_STREAMS["episodes"], k),
                size,
                True,
                s.action_noise * (k % s.levels) / (s.levels - 1),
                noisy=True,
            )
            for k, size in enumerate(self._sizes(s.episodes))
        ]
        return self._run(actor, groups, _TAKEN, self.folder / "episodes", "episodes")

    def _q(self, groups: list[dict[str, np.ndarray]], actor: SimActor) -> tuple[SensingQ, dict[str, float]]:
        s = self.settings
        looked_at = max(1, round(s.validation * len(groups) / s.levels)) * s.levels  # each level of noise
        parts = (groups[:-looked_at], groups[-looked_at:])
        if s.q_target == "return":
            train = self._to_learn_from(_of_returns(parts[0]), 3, "q")
            validation: Samples = self._samples(_of_returns(parts[1]), 4)
        else:
            drawn = self._to_learn_from(self._acted("q", parts[0]), 3, "q")
            train = ActedSamples(drawn, actor, 10 * s.seed + 3)
            validation = ActedSamples(
                self._samples(self._acted("check", parts[1]), 4), actor, 10 * s.seed + 4
            )
        fit = replace(s.q, seed=s.seed, device=s.device)
        q, result = fit_q(train, validation, fit, self.folder / "q", self._fit_progress("q"))
        return q, result.figures

    def _acted(self, name: str, groups: list[dict[str, np.ndarray]]) -> Scenes:
        """States of episodes, which the actor never learnt from, with the optimiser's action there."""
        path = self.folder / "episodes" / f"labelled_{name}.npz"
        if not path.exists():
            columns = ("values", "tip_in_base", "frames")
            rows = {c: np.concatenate([g[c] for g in groups]) for c in columns}
            stream = (_STREAMS["episodes"], 0, int(name == "q"))
            self._label(rows, stream, path.with_name(f"labels_{name}"), path, "episodes")
        rows = read_arrays(path, _LABELLED)
        return Scenes(rows["frames"], rows["tip_in_base"], {ACTION: rows["action"]})

    def _judged(self, actor: SimActor) -> dict[str, dict[str, float]]:
        """Success in the model, by its own judgement, of views held and of new ones for every action."""
        s, found = self.settings, {}
        for which, name in enumerate(("held", "new_each_step")):
            groups = [
                self._group((_STREAMS["judged"], which, k), size, name == "held", 0.0, noisy=False)
                for k, size in enumerate(self._sizes(s.judged))
            ]
            parts = self._run(actor, groups, _JUDGED, self.folder / "judged" / name, "judged")
            success, actions = (np.concatenate([part[n] for part in parts]) for n in _JUDGED)
            found[name] = {
                "episodes": len(success),
                "success": float(success.mean()),
                "median_actions": float(np.median(actions)),
            }
            self.tell("judged", {f"success_{name}": found[name]["success"]})
        return found

    def _sizes(self, count: int) -> list[int]:
        """Of the groups of so many episodes."""
        size = self.settings.group
        return [min(size, count - first) for first in range(0, count, size)]

    def _group(self, stream: tuple[int, ...], count: int, hold: bool, noise: float, noisy: bool) -> Group:
        s = self.settings
        drawn = self.randomising.distribution if noisy else None  # what is judged is the task as it is
        return Group((s.seed, *stream), count, hold, noise, noisy, s.max_actions, drawn)

    def _run(
        self, actor: SimActor, groups: list[Group], names: tuple[str, ...], folder: Path, stage: str
    ) -> list[dict[str, np.ndarray]]:
        s = self.settings
        return kept_groups(
            self.task.name,
            actor,
            groups,
            names,
            folder,
            s.device,
            s.workers,
            lambda row: self.tell(stage, row),
        )

    def _keep(self, network: SimActor | SensingQ, figures: dict[str, float]) -> None:
        kind = "sim_actor" if isinstance(network, SimActor) else "sensing_q"
        lens, limit = self.model.cell.intrinsics, self.task.action_limit
        info = WeightsInfo(kind, self.task.name, lens, limit, self.settings.seed, figures, self.commit)
        save_weights(self.folder / f"{self.task.name}_{kind}.safetensors", network, info)


def _split(states: StateSamples, share: float) -> tuple[StateSamples, StateSamples]:
    """By order: neighbours are of the same episodes, a random split would look at what it knows."""
    kept = round((1.0 - share) * len(states))
    return states.rows(slice(0, kept)), states.rows(slice(kept, None))


def _joined(parts: list[Scenes]) -> Scenes:
    frames, tips = (np.concatenate([getattr(p, name) for p in parts]) for name in ("frames", "tip_in_base"))
    return Scenes(frames, tips, {ACTION: np.concatenate([p.targets[ACTION] for p in parts])})


def _of_returns(groups: list[dict[str, np.ndarray]]) -> Scenes:
    return Scenes.of_returns({name: np.concatenate([g[name] for g in groups]) for name in groups[0]})


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings by dotted names, so that a refusal can name the one that differs."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return flat


def _commit() -> str:
    """Of the source tree that trains, empty outside one."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
