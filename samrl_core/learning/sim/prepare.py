"""Makes the labelled states of a task, in as many processes as there are free cores; resumable.

`python -m samrl_core.learning.sim.prepare TASK --count N --out DIR --seed S --workers W`
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import SamrlError
from samrl_core.common.executor import free_cores, run_calls
from samrl_core.common.files import folder_lock
from samrl_core.learning.data.shards import DataInfo, ShardFolder
from samrl_core.learning.images.batch_render import model_of
from samrl_core.learning.sim.sample_states import StateSource, sample_states
from samrl_core.learning.states.frames import SceneFrames
from samrl_core.learning.states.states import StateSamples
from samrl_core.policy.planning.expert import label_of

_CHUNK = 40  # states that one process labels in one go
SHARD_SIZE = 500  # states: half a minute to a minute of one core

Progress = Callable[[int, int], None]  # samples made, samples wanted


def prepare_states(
    task: str,
    count: int,
    folder: Path,
    seed: int,
    workers: int = 0,
    source: StateSource | None = None,
    shard_size: int = SHARD_SIZE,
    progress: Progress = lambda done, wanted: None,
    cell: str = DEFAULT_CELL,
) -> StateSamples:
    """All labelled states of a data set, made or resumed.

    Args:
        task: name of the task.
        count: states in all.
        folder: of the data set.
        seed: of the data set.
        workers: processes; 0 takes as many as there are free cores.
        source: where they come from; physical parameters are sampled once per shard.
        shard_size: states that one process makes in one go.
        progress: called after each shard.
        cell: name of the cell whose arm moves.

    Raises:
        InputError: the folder holds another data set, or a setting is outside its meaning.
    """
    source = source or StateSource()
    recorded = _recorded(SceneFrames(model_of(task, cell)).names, source) | _of_cell(cell)
    info = DataInfo("states", task, cell_named(cell).intrinsics, seed, count, shard_size, recorded)
    data = ShardFolder(folder, info)
    _fill(data, _shard, lambda k: (task, cell, info, k, source), workers, progress)
    return load_states(folder, task)


def load_states(folder: Path, task: str) -> StateSamples:
    """All states of a finished data set.

    Raises:
        InputError: there is none, or it is unfinished, damaged, or of another task.
    """
    data = ShardFolder.open(folder, "states", task)
    return StateSamples.joined([StateSamples.from_arrays(arrays) for arrays in data.read_all()])


def label_all(
    task: str,
    values: np.ndarray,
    tips: np.ndarray,
    folder: Path,
    workers: int = 0,
    progress: Progress = lambda done, wanted: None,
    shard_size: int = _CHUNK,
    cell: str = DEFAULT_CELL,
) -> tuple[np.ndarray, np.ndarray]:
    """The optimiser's first action in states that something else came to, e.g. the actor; resumable.

    Args:
        task: name of the task.
        values: (N, P).
        tips: (N, 3) in the tool arm's base frame [m].
        folder: of these labels alone.
        workers: processes; 0 takes as many as there are free cores.
        progress: called after each shard.
        shard_size: labels that one process makes in one go.
        cell: name of the cell whose arm moves.

    Returns:
        Actions (N, 3) [m], and whether anything is left to do there (N,) bool.

    Raises:
        InputError: the folder holds labels of other states, or damaged ones.
    """
    digest = hashlib.sha256(np.hstack([values, tips]).astype("<f8").tobytes()).hexdigest()
    recorded = {"states_sha256": digest} | _of_cell(cell)
    info = DataInfo("labels", task, cell_named(cell).intrinsics, 0, len(values), shard_size, recorded)
    data = ShardFolder(folder, info)

    def job(shard: int) -> tuple[str, str, np.ndarray, np.ndarray]:
        few = slice(shard * shard_size, (shard + 1) * shard_size)
        return task, cell, values[few], tips[few]

    _fill(data, _labels, job, workers, progress)
    parts = list(data.read_all())
    return np.concatenate([p["action"] for p in parts]), np.concatenate([p["left"] for p in parts])


def _fill(
    data: ShardFolder,
    work: Callable[..., dict[str, np.ndarray]],
    job: Callable[[int], tuple[Any, ...]],
    workers: int,
    progress: Progress,
) -> None:
    """Makes the shards that are missing, `work(*job(shard))` each, and keeps each one at once."""
    info, missing = data.info, data.missing()
    done = info.count - sum(info.size(k) for k in missing)
    progress(done, info.count)

    def write(shard: int, arrays: dict[str, np.ndarray]) -> None:
        nonlocal done
        data.write(shard, arrays)
        done += info.size(shard)
        progress(done, info.count)

    calls = [partial(work, *job(shard)) for shard in missing]
    for made in run_calls(calls, workers or free_cores()):
        write(missing[made.index], made.result)


def _of_cell(cell: str) -> dict[str, object]:
    """Recorded of another cell than the default one, which older folders do not name."""
    return {} if cell == DEFAULT_CELL else {"cell": cell}


def _recorded(frames: tuple[str, ...], source: StateSource) -> dict[str, object]:
    """What a shard depends on besides seed, task and cell, and what its frames are."""
    given, distribution = source.given, source.distribution
    starts = [] if given is None else np.hstack([given.values, given.tip_in_base]).tolist()
    found: dict[str, object] = {"frames": frames, "explore": asdict(source.explore), "given": starts}
    if distribution is not None:
        found["drawn"] = distribution.record()
    return found


def _labels(task: str, cell: str, values: np.ndarray, tips: np.ndarray) -> dict[str, np.ndarray]:
    model = model_of(task, cell)
    labels = [label_of(model.dynamics, model.task, v, t) for v, t in zip(values, tips, strict=True)]
    return {
        "action": np.array([label.action for label in labels]),
        "left": np.array([label.sub_goal != "none" for label in labels]),
    }


def _shard(task: str, cell: str, info: DataInfo, shard: int, source: StateSource) -> dict[str, np.ndarray]:
    return sample_states(model_of(task, cell), info.rng(shard), info.size(shard), source).arrays()


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m samrl_core.learning.sim.prepare", description=__doc__)
    parser.add_argument("task", help="name of the task")
    parser.add_argument("--count", type=int, default=12_000, help="states in all")
    parser.add_argument("--out", type=Path, required=True, help="folder of the data set")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--workers", type=int, default=0, help="processes; 0: as many as there are free cores"
    )
    a = parser.parse_args(arguments)
    torch.set_num_threads(1)
    begun = time.monotonic()

    def print_progress(done: int, wanted: int) -> None:
        print(f"{a.task}: {done} of {wanted} states, {time.monotonic() - begun:.0f} s", flush=True)

    try:
        with folder_lock(a.out):
            states = prepare_states(a.task, a.count, a.out, a.seed, a.workers, progress=print_progress)
    except SamrlError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{a.task}: {100 * states.solved.mean():.1f} % reach their sub-goal in the model", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
