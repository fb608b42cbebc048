"""Episodes of an actor that are kept group by group, so that a killed training runs only what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.executor import free_cores
from samrl_core.learning.sim.episodes import EpisodeGroup, run_groups
from samrl_core.policy.networks.networks import SimActor

Log = Callable[[dict[str, float]], None]  # hears how many groups there are


def run_cached_groups(
    task: str,
    actor: SimActor,
    groups: Sequence[EpisodeGroup],
    names: Sequence[str],
    folder: Path,
    device: str,
    workers: int,
    log: Log,
) -> list[dict[str, np.ndarray]]:
    """Each group's arrays, in the order of the groups: run now, or read from the file of an earlier call.

    Args:
        task: name of the task.
        actor: acts.
        groups: each follows from its own seed; the folder is of these alone.
        names: fields of `Rollouts` that are kept; `success` is one of them.
        folder: gets a file for each group as soon as it has ended.
        device: of the images and the actor.
        workers: processes; 0 takes the free cores.
        log: called at first and after each group.

    Raises:
        InputError: a file is damaged or another's; otherwise as `run_groups`.
    """
    paths = [folder / f"{k:04d}.npz" for k in range(len(groups))]
    missing = [k for k, path in enumerate(paths) if not path.exists()]
    done = len(paths) - len(missing)
    log({"groups": done, "of": len(paths)})
    left = [groups[k] for k in missing]
    for k, run in run_groups(task, actor, left, device, workers or free_cores()):
        write_arrays(paths[missing[k]], {name: getattr(run, name) for name in names})
        done += 1
        log({"groups": done, "of": len(paths), "success": float(run.success.mean())})
    return [read_arrays(path, names) for path in paths]
