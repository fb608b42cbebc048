"""Tasks by name. A task is a folder with its scene and rules; it never sees a simulator."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping

from samrl_core.cell.tasks.hard import hard
from samrl_core.cell.tasks.needle_threading.task import NeedleThreading
from samrl_core.cell.tasks.occluded import occluded
from samrl_core.cell.tasks.peg_insertion.task import PegInsertion
from samrl_core.cell.tasks.spatula_flipping.task import SpatulaFlipping
from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError

TASKS: dict[str, Task] = {task.name: task for task in (PegInsertion(), SpatulaFlipping(), NeedleThreading())}
DEFAULT_TASK = "peg_insertion"
OCCLUDED_TASKS: dict[str, Task] = {task.name: task for task in occluded()}  # variants with a screen
HARD_TASKS: dict[str, Task] = {task.name: task for task in hard()}  # tight, spread wide, with a force limit
EVERY_TASK: Mapping[str, Task] = ChainMap(TASKS, OCCLUDED_TASKS, HARD_TASKS)


def task_named(name: str) -> Task:
    """The task of that name, with its default settings.

    Raises:
        InputError: there is no such task.
    """
    if name not in EVERY_TASK:
        raise InputError(f"no task is named {name!r}; there are: {', '.join(sorted(EVERY_TASK))}")
    return EVERY_TASK[name]


def plain_name(name: str) -> str:
    """The task that this one is a variant of, which networks may have been trained on; its own if of none."""
    task = EVERY_TASK.get(name)
    return name if task is None else task.variant_of or name
