"""Episodes of an actor in the model, as a training needs them: to label, to learn Q from, and to evaluate.

All of them are kept in the training's folder, part by part; what is there is not run again.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.streams import stream
from samrl_core.learning.data.fit import ACTION
from samrl_core.learning.images.rendered_samples import Scenes
from samrl_core.learning.sim.episodes import EpisodeGroup, run_cached_groups
from samrl_core.learning.sim.prepare import label_all
from samrl_core.learning.sim.randomising import Randomising
from samrl_core.learning.sim.rollouts import PER_ACTION
from samrl_core.learning.sim.train_settings import TrainSettings
from samrl_core.policy.networks.networks import SimActor

Log = Callable[[str, dict[str, float]], None]  # stage, its metrics so far
_LABELLED = ("values", "tip_in_base", "frames", "action")  # of labelled states
_VISITED = ("values", "tip_in_base", "frames", "success")  # of a round's episodes
_EVALUATED = ("success", "actions")
_TAKEN = (*PER_ACTION, "success")  # of Q's episodes


class ActorEpisodes:
    """Of one training."""

    def __init__(
        self, task: str, folder: Path, settings: TrainSettings, randomising: Randomising, log: Log
    ) -> None:
        """`folder` is the training's; `randomising` has the distribution of the models of noisy episodes."""
        self._task, self._folder, self._settings = task, folder, settings
        self._randomising, self._log = randomising, log

    def round(self, k: int, actor: SimActor) -> Scenes:
        """States that the actor visits, with the optimiser's action there."""
        path = self._folder / f"round-{k}" / "labelled.npz"
        if not path.exists():
            self._make_round(k, actor, path)
        rows = read_arrays(path, _LABELLED)
        return Scenes(rows["frames"], rows["tip_in_base"], {ACTION: rows["action"]})

    def _make_round(self, k: int, actor: SimActor, path: Path) -> None:
        s, stage = self._settings, f"round-{k}"
        half = s.round_episodes // 2
        groups = [
            self._group(
                ("round", k, "held" if hold else "new_each_step", number), size, hold, 0.0, noisy=True
            )
            for hold in (True, False)
            for number, size in enumerate(self._sizes(max(1, half)))
        ]
        visited = self._run(actor, groups, _VISITED, path.parent / "episodes", stage)
        values, tips, frames = (
            np.concatenate([one[name] for one in visited]) for name in ("values", "tip_in_base", "frames")
        )
        rows = {"values": values, "tip_in_base": tips, "frames": frames}
        self._label(rows, ("round", k), path.parent / "labels", path, stage)

    def _label(
        self, rows: dict[str, np.ndarray], of: tuple[str | int, ...], folder: Path, path: Path, stage: str
    ) -> None:
        """Writes states with the optimiser's action there, at most as many as the training has states.

        Episodes that got stuck repeat the same states, so that more of them teach nothing.
        """
        s = self._settings
        count = len(rows["values"])
        rng = stream(s.seed, *of, "labelled")
        which = np.sort(rng.choice(count, min(count, s.states), replace=False))
        chosen = {name: array[which] for name, array in rows.items()}
        action, left = label_all(
            self._task,
            chosen["values"],
            chosen["tip_in_base"],
            folder,
            s.workers,
            lambda done, wanted: self._log(stage, {"labelled": done, "of": wanted}),
            cell=s.cell,
        )
        write_arrays(path, {name: array[left] for name, array in {**chosen, "action": action}.items()})

    def for_q(self, actor: SimActor) -> list[dict[str, np.ndarray]]:
        """For Q: with rising noise on the actions, so that bad ones are in the data too; views are held."""
        s = self._settings
        groups = [
            self._group(
                ("episodes", k), size, True, s.action_noise * (k % s.levels) / (s.levels - 1), noisy=True
            )
            for k, size in enumerate(self._sizes(s.episodes))
        ]
        return self._run(actor, groups, _TAKEN, self._folder / "episodes", "episodes")

    def labelled(self, name: str, groups: list[dict[str, np.ndarray]]) -> Scenes:
        """States of episodes, which the actor never learnt from, with the optimiser's action there."""
        path = self._folder / "episodes" / f"labelled_{name}.npz"
        if not path.exists():
            columns = ("values", "tip_in_base", "frames")
            rows = {c: np.concatenate([g[c] for g in groups]) for c in columns}
            self._label(rows, ("episodes", name), path.with_name(f"labels_{name}"), path, "episodes")
        rows = read_arrays(path, _LABELLED)
        return Scenes(rows["frames"], rows["tip_in_base"], {ACTION: rows["action"]})

    def evaluate(self, actor: SimActor) -> dict[str, dict[str, float]]:
        """Success rate in the model, by `Task.is_done`, with held views and with a new view per action."""
        s, found = self._settings, {}
        for name in ("held", "new_each_step"):
            groups = [
                self._group(("judged", name, k), size, name == "held", 0.0, noisy=False)
                for k, size in enumerate(self._sizes(s.judged))
            ]
            parts = self._run(actor, groups, _EVALUATED, self._folder / "judged" / name, "judged")
            success, actions = (np.concatenate([part[n] for part in parts]) for n in _EVALUATED)
            found[name] = {
                "episodes": len(success),
                "success": float(success.mean()),
                "median_actions": float(np.median(actions)),
            }
            self._log("judged", {f"success_{name}": found[name]["success"]})
        return found

    def _sizes(self, count: int) -> list[int]:
        """Of the groups of so many episodes."""
        size = self._settings.group
        return [min(size, count - first) for first in range(0, count, size)]

    def _group(
        self, of: tuple[str | int, ...], count: int, hold: bool, noise: float, noisy: bool
    ) -> EpisodeGroup:
        s = self._settings
        distribution = self._randomising.distribution if noisy else None  # evaluation takes the task as it is
        return EpisodeGroup(
            s.seed,
            of,
            count,
            hold,
            noise,
            noisy,
            s.max_actions,
            distribution,
            cell=s.cell,
            correction=self._randomising.correction,
        )

    def _run(
        self, actor: SimActor, groups: list[EpisodeGroup], names: tuple[str, ...], folder: Path, stage: str
    ) -> list[dict[str, np.ndarray]]:
        s = self._settings
        return run_cached_groups(
            self._task,
            actor,
            groups,
            names,
            folder,
            s.device,
            s.workers,
            lambda row: self._log(stage, row),
        )
