"""What Real2Sim found in the cell, as a file: line 16 of Algorithm 1 stores it, line 17 learns from it.

Each row is an estimate that an image was fitted to, and where the tool's tip was in that image. The rows of
an episode, in order, are also what the cell did under the actions between them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.task import Task
from samrl_core.common.array_file import read_arrays, write_arrays
from samrl_core.common.errors import InputError
from samrl_core.learning.states.explore import Starts

FORMAT = 1
FITTED = ("converged", "iteration_limit")  # how an update ends that an image has spoken to
_HEADER = "samrl_visited_states"


@dataclass(frozen=True, eq=False)
class VisitedStates:
    """N estimates of one task.

    Raises:
        InputError: an unknown task, shapes that do not fit it, or a number that is not finite.
    """

    task: str
    values: np.ndarray  # (N, P) in the order of `Task.parameters`
    covariance: np.ndarray  # (N, P, P)
    tip_in_base: np.ndarray  # (N, 3) tool tip in the tool arm's base frame [m]
    episode: np.ndarray  # (N,) int64
    step: np.ndarray  # (N,) int64, actions executed before; an update after a camera move repeats it

    def __post_init__(self) -> None:
        count, size = len(self.values), len(task_named(self.task).parameters())
        wanted = {
            "values": (count, size),
            "covariance": (count, size, size),
            "tip_in_base": (count, 3),
            "episode": (count,),
            "step": (count,),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if array.shape != shape:
                raise InputError(
                    f"{name} of visited states has shape {array.shape}, must be {shape} for {count} of "
                    f"{self.task}"
                )
            if array.dtype.kind not in ("iu" if len(shape) == 1 else "f") or not np.isfinite(array).all():
                raise InputError(f"{name} of visited states must be finite numbers, is of {array.dtype}")

    def __len__(self) -> int:
        return len(self.values)

    def arrays(self) -> dict[str, np.ndarray]:
        """Fields with a row per estimate, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "task"}

    def rows(self, which: np.ndarray | slice) -> VisitedStates:
        """Some of them."""
        return VisitedStates(self.task, **{name: array[which] for name, array in self.arrays().items()})

    @staticmethod
    def joined(parts: Sequence[VisitedStates]) -> VisitedStates:
        """All of several files, in order; episodes are numbered on, so that none is two.

        Raises:
            InputError: none, or of different tasks.
        """
        tasks = sorted({part.task for part in parts})
        if len(tasks) != 1:
            raise InputError(f"visited states of {tasks or 'no task'} cannot be joined; hand in those of one")
        columns: dict[str, list[np.ndarray]] = {}
        next_episode = 0
        for part in parts:
            numbered = np.unique(part.episode, return_inverse=True)[1].astype(np.int64) + next_episode
            next_episode = int(numbered.max(initial=next_episode - 1)) + 1
            for name, array in (part.arrays() | {"episode": numbered}).items():
                columns.setdefault(name, []).append(array)
        return VisitedStates(tasks[0], **{name: np.concatenate(arrays) for name, arrays in columns.items()})

    def starts(self, task: Task) -> Starts:
        """Those that something can be learnt in: within the parameters' bounds, and not done.

        Raises:
            InputError: there is none.
        """
        specs = task.parameters()
        lower, upper = (np.array([getattr(p, name) for p in specs]) for name in ("lower", "upper"))
        inside = ((self.values >= lower) & (self.values <= upper)).all(axis=1)
        done = [task.is_done(*pair) for pair in zip(self.values, self.tip_in_base, strict=True)]
        usable = inside & ~np.array(done, dtype=bool)
        if not usable.any():
            raise InputError(
                f"none of {len(self)} visited states of {self.task} is within the task's bounds with "
                f"something left to do; record other episodes"
            )
        return Starts(self.values[usable], self.tip_in_base[usable])


def save_visited(path: Path, states: VisitedStates) -> None:
    """Write a file; `path` holds the old one or the whole new one at any instant."""
    header = json.dumps({"format": FORMAT, "task": states.task, "names": list(_names(states.task))})
    write_arrays(path, {_HEADER: np.array(header), **states.arrays()})


def load_visited(path: Path, task: str) -> VisitedStates:
    """Read such a file; nothing in it is run.

    Raises:
        InputError: there is none, it is damaged or of something else, or of another task.
    """
    if not path.is_file():
        raise InputError(f"no file of visited states at {path}; `samrl cell` leaves one in its folder")
    names = {f.name for f in fields(VisitedStates)} - {"task"}
    try:
        arrays = read_arrays(path, names | {_HEADER})
        header = json.loads(str(arrays.pop(_HEADER)))
        about = (header["format"], header["task"], tuple(header["names"]))
    except (InputError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path} is no whole file of visited states ({error}); hand in one that `samrl cell` has left"
        ) from error
    if about[0] != FORMAT:
        raise InputError(f"{path} is of format {about[0]}, this version reads {FORMAT}; record it anew")
    if about[1:] != (task, _names(task)):
        raise InputError(
            f"{path} holds states of {about[1]} with {list(about[2])}, wanted is {task} with "
            f"{list(_names(task))}"
        )
    return VisitedStates(task, **arrays)


def _names(task: str) -> tuple[str, ...]:
    return tuple(spec.name for spec in task_named(task).parameters())
