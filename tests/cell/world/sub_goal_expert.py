"""An expert that follows a task's own sub-goals, told what no sensor says: the true parameters.

It shows that a world can be solved under this cell's controller, not what a learner can do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.world.evaluation import ending_now
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.tool_motion import ToolMotion
from samrl_core.cell.world.world import SimulatedWorld, Truth
from tests.cell.world.scripted_expert import Episode


@dataclass(frozen=True)
class Pace:
    """How the expert acts."""

    period_s: float = 0.1  # of an action [s]
    rest_s: float = 0.5  # after the last action, for bodies to come to rest [s]
    noise: float = 0.0  # standard deviation of an action's error, relative to its length, per axis [-]


Choice = Callable[[np.ndarray, np.ndarray], np.ndarray | None]  # values (P,), tip (3,) -> action (3,) [m]


def straight(task: Task) -> Choice:
    """Straight to the first sub-goal; None when done."""

    def choose(values: np.ndarray, tip: np.ndarray) -> np.ndarray | None:
        goals = task.sub_goals(values, tip)
        if not goals:
            return None
        step = goals[0].tip_position - tip
        return step * min(1.0, goals[0].max_step / max(float(np.linalg.norm(step)), 1e-9))

    return choose


def follow(
    world: SimulatedWorld,
    task: Task,
    cell: CellSpec,
    values_of: Callable[[Truth], np.ndarray],
    seed: int,
    pace: Pace | None = None,
    watch: Callable[[int], None] = lambda action: None,
    choose: Choice | None = None,
) -> Episode:
    """One episode; `values_of` makes the task's parameters of the truth, `watch` is called at each action.

    `choose` makes the action; without it, straight to the first sub-goal.
    """
    pace = pace or Pace()
    choose = choose or straight(task)
    world.reset(seed)
    motion = ToolMotion(world, task, cell, pace.period_s)
    rng = np.random.default_rng(1000 + seed)
    done, actions = False, 0
    while actions < task.max_actions:
        step = choose(values_of(world.truth()), motion.tip())
        if step is None:
            done = True
            break
        watch(actions)
        actions += 1
        step = step + pace.noise * np.linalg.norm(step) * rng.standard_normal(3)
        motion.displace(step)
    for _ in range(round(pace.rest_s * 1e3)):
        world.advance()
    watch(actions)
    truth = world.truth()
    ending = ending_now(truth)
    return Episode(task.succeeded(ending), done, actions, truth.peak_contact_force, task.final_error(ending))


def episodes(
    task: Task,
    cell: CellSpec,
    values_of: Callable[[Truth], np.ndarray],
    seeds: Sequence[int],
    pace: Pace,
    choose: Choice | None = None,
) -> list[Episode]:
    """One per seed, all in the same PyBullet world."""
    world = PyBulletWorld(task, cell)
    found = [follow(world, task, cell, values_of, seed, pace, choose=choose) for seed in seeds]
    world.close()
    return found
