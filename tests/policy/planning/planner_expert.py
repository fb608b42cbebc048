"""An expert that plans through the model, told what Real2Sim would estimate: the parameters, with errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.spatula_flipping.task import PANCAKE, SpatulaFlipping
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.world.evaluation import true_values
from samrl_core.cell.world.world import Truth
from samrl_core.model.task_dynamics.choose import dynamics_of
from samrl_core.model.task_dynamics.settings import TaskPhysicsSettings
from samrl_core.policy.planning.trajectory import TrajectorySettings, optimise
from tests.cell.world.scripted_expert import Episode
from tests.cell.world.sub_goal_expert import Choice, Pace, episodes

CELL = cell_named()


@dataclass(frozen=True)
class Error:
    """Standard deviation of what the expert is told, new for each action."""

    place: float = 0.0  # [m]
    angle: float = 0.0  # [rad]


def told(task: Task, error: Error, seed: int) -> Callable[[Truth], np.ndarray]:
    """The parameters with an error; a pancake is never told to be inside the table."""
    rng = np.random.default_rng(seed)
    deviation = np.array([error.place if p.unit == "m" else error.angle for p in task.parameters()])

    def values(truth: Truth) -> np.ndarray:
        found = true_values(task, truth) + deviation * rng.standard_normal(len(deviation))
        if isinstance(task, SpatulaFlipping):
            found[2] = max(found[2], 0.5 * task.pancake_thickness)
        return found

    return values


def planned(task: Task, horizon: int = 3, rest_s: float = 0.0) -> Choice:
    """The first action of a plan through the model; None when done."""
    dynamics = dynamics_of(task, CELL, TaskPhysicsSettings(rest_s=rest_s))
    settings = TrajectorySettings(max_sub_goals=horizon)

    def choose(values: np.ndarray, tip: np.ndarray) -> np.ndarray | None:
        if task.is_done(values, tip):
            return None
        plan = optimise(dynamics, task, dynamics.start(values, tip), settings)
        return plan.actions[0] if len(plan.actions) else np.zeros(3)

    return choose


def run(name: str, seeds: Sequence[int], error: Error | None = None, noise: float = 0.0) -> list[Episode]:
    """Episodes of a task in the PyBullet world."""
    task = task_named(name)
    values = told(task, error or Error(), 7)
    return episodes(task, CELL, values, seeds, Pace(noise=noise), planned(task))


__all__ = ["CELL", "PANCAKE", "Error", "planned", "run", "told"]
