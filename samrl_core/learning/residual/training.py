"""Training of the residual beside a running cell: steps come in through a replay, weights go out as files.

Everything lies in one folder and outlives its process: the replay, the state of the training, the weights by
version, what is in force (`announced.json`), a row per update (`training.csv`) and a summary.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.common.errors import InputError, SolveError
from samrl_core.common.files import append_line, write_whole
from samrl_core.learning.data.checkpoint import load_checkpoint, save_checkpoint
from samrl_core.learning.data.fit import STOPPED
from samrl_core.learning.residual.learner import Learner, LearnerSettings
from samrl_core.learning.residual.learners import create_learner, settings_to_json, update_names
from samrl_core.learning.residual.replay import End, Replay, ReplayInfo
from samrl_core.learning.residual.td3 import TD3Settings
from samrl_core.learning.residual.transitions import (
    StepFeatures,
    Transitions,
    encoder_sha256,
    transitions_of,
)
from samrl_core.policy.networks.networks import Encoder
from samrl_core.policy.networks.weights import WeightsInfo, save_weights, sha256_of

KIND = "residual_training"
KEPT_VERSIONS = 50  # weight files, 0.5 MB each: the node may be some versions behind
RECENT_EPISODES = 20  # of the success rate in the summary
IDLE_S = 0.2  # between readings of the replay while no update is due


@dataclass(frozen=True)
class TrainingSettings:
    """How the training goes along with the cell.

    Raises:
        InputError: a value outside its limits.
    """

    learner: LearnerSettings = TD3Settings()  # which learner follows from their type
    seed: int = 0
    capacity: int = 10_000  # steps of the replay; 82 kB each
    first_steps: int = 200  # in the replay before the first update
    updates_per_step: float = 2.0  # updates that each further step allows
    publish_every: int = 50  # updates between two versions
    cpu_share: float = 0.5  # of one core

    def __post_init__(self) -> None:
        for name in ("capacity", "first_steps", "publish_every"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}, must be at least 1")
        if not (self.updates_per_step > 0 and 0 < self.cpu_share <= 1):
            raise InputError(
                f"updates_per_step is {self.updates_per_step}, must be above 0; cpu_share {self.cpu_share}, "
                f"must be above 0 and at most 1"
            )


@dataclass(frozen=True)
class Announcement:
    """Which weights are in force; version 0 is the zero residual and has no file."""

    task: str
    version: int = 0
    file: str = ""
    sha256: str = ""
    steps: int = 0  # in the replay at that time: no two runs that collect begin at the same


def announced(folder: Path, task: str) -> Announcement:
    """What was last published in a training's folder.

    Raises:
        InputError: the file there is not readable, or another task's.
    """
    path = folder / "announced.json"
    if not path.is_file():
        return Announcement(task)
    try:
        found = Announcement(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise InputError(f"cannot read {path} ({error}); remove it to begin anew") from error
    texts = (found.task, found.file, found.sha256)
    if type(found.version) is not int or found.version < 0 or not all(isinstance(t, str) for t in texts):
        raise InputError(f"{path} announces {found}, which is no version and file; remove it to begin anew")
    if found.task != task:
        raise InputError(f"{folder} holds the residual of {found.task!r}, not of {task!r}; give another")
    if not found.version:
        return found
    file = folder.resolve() / found.file  # a folder may be moved between two runs
    if not file.is_file():
        raise InputError(f"{path} announces {file}, which is not there; put it back, or remove {path.name}")
    return replace(found, file=str(file))


def announcement_of(file: Path, task: str) -> Announcement:
    """A weight file as version 1; whoever acts by it checks what it holds.

    Raises:
        InputError: there is no such file.
    """
    if not file.is_file():
        raise InputError(f"no residual at {file}; give a `residual_actor` weight file")
    return Announcement(task, 1, str(file.resolve()), sha256_of(file))


def replay_of(folder: Path, task: str, cell: CellSpec, settings: TrainingSettings) -> tuple[Path, ReplayInfo]:
    """Where the replay of a training lies and what it holds."""
    return folder / "replay.bin", ReplayInfo(task, cell.intrinsics, settings.capacity)


class ResidualTraining:
    """One training; `step` does the next update. It goes on where the folder's last checkpoint is.

    Raises:
        InputError: what lies in the folder is corrupt, or was made with other settings of the learner.
    """

    def __init__(
        self,
        folder: Path,
        task: str,
        cell: CellSpec,
        encoder: Encoder,
        settings: TrainingSettings,
        log: Callable[[str], None] = print,
    ) -> None:
        """Reads what is there.

        Args:
            folder: of this training alone.
            task: its name.
            cell: whose camera the replay's images are of.
            encoder: the nominal policy's.
            settings: of the training.
            log: gets a message when the folder's replay is not the checkpoint's; by default the worker's log.
        """
        self._log_message = log
        self._granted = 0  # updates that the steps of earlier replays allowed
        self._folder, self._task, self._cell, self._settings = folder, task, cell, settings
        self._replay = Replay.read(*replay_of(folder, task, cell, settings))
        self._learner = create_learner(settings.learner, encoder, settings.seed)
        self._features = StepFeatures(self._replay, cell, encoder)
        self._transitions: Transitions | None = None
        self._metrics: dict[str, float] | None = None
        self._about = {
            "task": task,
            "seed": settings.seed,
            "learner": settings_to_json(settings.learner),
            "encoder": encoder_sha256(encoder),
        }
        self.version = announced(folder, task).version
        if self._checkpoint.exists():
            self._resume()
        self._log = _Log(folder / "training.csv", self._learner.METRICS, self._learner.updates)

    @property
    def updates(self) -> int:
        """Updates done, those of earlier processes included."""
        return self._learner.updates

    @property
    def learner(self) -> Learner:
        """What is being trained."""
        return self._learner

    def due(self) -> bool:
        """Whether the steps that came in allow another update."""
        self._replay.refresh()
        self._features.add_new()
        s = self._settings.learner
        self._transitions = transitions_of(self._replay, s.n_step, s.gamma)
        steps = max(0, self._replay.last - self._settings.first_steps + 1)
        allowed = self._granted + self._settings.updates_per_step * steps
        return len(self._transitions) > 0 and self.updates < allowed

    def step(self) -> dict[str, float]:
        """One update on a batch of the replay; publishes when it is time.

        Raises:
            SolveError: a loss or gradient is not finite; the state that led to it is saved as
                `stopped.safetensors`.
        """
        if self._transitions is None and not self.due():
            raise InputError("no update is due: ask `due` first")
        assert self._transitions is not None
        learner = self._learner
        try:
            metrics = learner.update(partial(self._features.sample_batch, self._transitions))
        except SolveError as error:
            save_checkpoint(self._folder / STOPPED, KIND, learner.state(), self._about)
            self._summarise(str(error))
            raise
        self._metrics = metrics
        self._log.add(learner.updates, self._replay.last, metrics)
        if learner.updates % self._settings.publish_every == 0:
            self._publish()
        return metrics

    def run(self, stop: Callable[[], bool]) -> None:
        """Train while the cell runs until `stop` is set, then save.

        After each update it sleeps for as long as it takes to stay within its share of a core.
        """
        while not stop():
            used = time.process_time()
            if self.due():
                self.step()
                used = time.process_time() - used
                _sleep(used * (1.0 / self._settings.cpu_share - 1.0), stop)
            else:
                _sleep(IDLE_S, stop)
        self.save()

    def save(self) -> None:
        """Write the state, so that the next process goes on from here."""
        about = {**self._about, "steps": self._replay.last, "granted": self._granted}
        save_checkpoint(self._checkpoint, KIND, self._learner.state(), about)
        self._summarise("")

    @property
    def _checkpoint(self) -> Path:
        return self._folder / "checkpoint.safetensors"

    def _resume(self) -> None:
        tensors, about = load_checkpoint(self._checkpoint, KIND)
        steps, self._granted = int(about.pop("steps", 0)), int(about.pop("granted", 0))
        about["learner"] = update_names(about.get("learner", {}))
        if about != self._about:
            raise InputError(
                f"{self._checkpoint} was made with {about}, asked for is {self._about}; give another folder "
                f"or the same settings (and the same `sim_actor`: the residual uses its encoder)"
            )
        self._learner.load_state(tensors)
        if self._replay.last < steps:
            # Counted over all steps, the updates done would be ahead of what the new ones allow for long.
            self._granted = self.updates
            self._log_message(
                f"{self._checkpoint} has learnt from {steps} steps, {self._replay.path} holds "
                f"{self._replay.last}: another replay. Its steps count anew, the weights go on; remove the "
                f"checkpoint as well to begin anew"
            )

    def _publish(self) -> None:
        assert self._metrics is not None
        finite = {name: value for name, value in self._metrics.items() if math.isfinite(value)}
        info = WeightsInfo(
            "residual_actor",
            self._task,
            self._cell.intrinsics,
            self._settings.learner.limit,
            self._settings.seed,
            {"updates": self.updates, "steps": self._replay.last, **finite},
        )
        version = self.version + 1
        file = self._folder.resolve() / f"residual_v{version:06d}.safetensors"
        save_weights(file, self._learner.actor, info)
        self.version = version
        self.save()
        announcement = Announcement(self._task, version, file.name, sha256_of(file))
        write_whole(self._folder / "announced.json", json.dumps(asdict(announcement)).encode())
        for old in sorted(self._folder.glob("residual_v*.safetensors"))[:-KEPT_VERSIONS]:
            old.unlink()

    def _summarise(self, stopped: str) -> None:
        """What the training came to so far; successes are detected ones, as the cell can know them."""
        _, episodes, _, ends = self._replay.outline()
        ended = ends[(ends == End.SUCCESS) | (ends == End.FAILURE)]
        recent = ended[-RECENT_EPISODES:]
        summary: dict[str, Any] = {
            "schema": 1,
            "task": self._task,
            "version": self.version,
            "updates": self.updates,
            "steps": self._replay.last,
            "episodes": int(np.unique(episodes).size),
            "detected_successes": int((ended == End.SUCCESS).sum()),
            "episodes_ended": int(ended.size),
            "recent_detected_success_rate": float((recent == End.SUCCESS).mean()) if recent.size else None,
            "last_update": _finite_or_none(self._metrics) if self._metrics else None,
            "cpu_s": time.process_time(),
            "stopped": stopped,
            "settings": {**asdict(self._settings), "learner": settings_to_json(self._settings.learner)},
        }
        write_whole(self._folder / "summary.json", (json.dumps(summary, indent=1) + "\n").encode())


class _Log:
    """One row per update; rows of updates that a kill undid are dropped."""

    def __init__(self, path: Path, metrics: tuple[str, ...], updates: int) -> None:
        head = ",".join(("update", "steps", *metrics))
        rows = path.read_text().splitlines()[1:] if path.is_file() else []
        rows_before = [
            row for row in rows if row.split(",")[0].isdigit() and int(row.split(",")[0]) <= updates
        ]
        write_whole(path, ("\n".join([head, *rows_before]) + "\n").encode())
        self._path = path

    def add(self, update: int, steps: int, metrics: dict[str, float]) -> None:
        values = (f"{v:.6g}" if math.isfinite(v) else "" for v in metrics.values())
        append_line(self._path, ",".join((str(update), str(steps), *values)), outlives_power=False)


def _finite_or_none(values: dict[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


def _sleep(seconds: float, stop: Callable[[], bool]) -> None:
    """Sleep in short pieces: a signal does not end a sleep in Python."""
    end = time.monotonic() + seconds
    while not stop() and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, IDLE_S))
