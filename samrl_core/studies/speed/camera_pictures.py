"""Time per picture of a simulated cell instance beside the nominal cell, and a sheet of the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from samrl_core.cell.instance.cell_instance import NOMINAL, instance_named
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import TASKS, task_named
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.common.figure_file import save_figure
from samrl_core.studies.speed.timing import TimedCall, in_turn

SETTLED = 300  # controller periods before the pictures


def time_pictures(
    instances: Sequence[str], rounds: int, picture: Path, seed: int = 0, cell: str = DEFAULT_CELL
) -> dict[str, Any]:
    """Time `read_camera` of all tasks, in turn in one process, and draw what was read.

    Args:
        instances: names; the nominal cell is added.
        rounds: turns of every alternative; the median counts.
        picture: PNG with a row for each task.
        seed: of the episodes.
        cell: by name.

    Returns:
        Per task and instance, milliseconds and the ratio to the nominal cell.
    """
    names = [NOMINAL, *instances]
    figure, axes = plt.subplots(
        len(TASKS), len(names), figsize=(1.9 * len(names), 2.0 * len(TASKS)), squeeze=False
    )
    found: dict[str, Any] = {}
    for row, task in zip(axes, TASKS, strict=True):
        worlds = {name: _world(task, name, seed, cell) for name in names}
        times = in_turn([TimedCall(name, world.read_camera) for name, world in worlds.items()], rounds)
        found[task] = {
            name: {"ms": 1e3 * one.seconds, "ratio": one.seconds / times[NOMINAL].seconds}
            for name, one in times.items()
        }
        for axis, (name, world) in zip(row, worlds.items(), strict=True):
            axis.imshow(world.read_camera().color)
            axis.set_axis_off()
            axis.set_title(name, fontsize=8)
            world.close()
    figure.tight_layout()
    save_figure(figure, picture, dpi=110)
    plt.close(figure)
    return found


def _world(task: str, instance: str, seed: int, cell: str) -> PyBulletWorld:
    spec = cell_named(cell)
    world = PyBulletWorld(task_named(task), spec, instance=instance_named(instance, spec))
    world.reset(seed)
    for _ in range(SETTLED):
        world.advance()
    return world
