"""The action to imitate: the first of a trajectory through the model (eqs. 18-22)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import SolveError
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics
from samrl_core.policy.planning.trajectory import TrajectorySettings, optimise

# One sub-goal: the search for the next one begins where the last one ended, so it never changes the first.
FIRST_GOAL = TrajectorySettings(max_sub_goals=1, max_iterations=3, spare_actions=1)


@dataclass(frozen=True, eq=False)
class Label:
    """What the optimiser does in a state."""

    sub_goal: str  # that it heads for; "none" when the task is done
    action: np.ndarray  # (3,) displacement of the tip [m]
    solved: bool  # the model reaches the sub-goal; else this is the best found, or the straight line
    why_straight: str = ""  # why the model could follow no way, so that this is the straight line


def label_of(
    dynamics: TaskDynamics,
    task: Task,
    values: np.ndarray,
    tip: np.ndarray,
    settings: TrajectorySettings = FIRST_GOAL,
) -> Label:
    """The optimiser's first action in a state at rest, which is all that an image shows of it.

    Args:
        dynamics: eq. 19.
        task: names the sub-goals.
        values: (P,) in the order of `Task.parameters`.
        tip: (3,) in the tool arm's base frame [m].
        settings: of the search.

    Raises:
        InputError: wrong shapes or non-finite numbers.
    """
    goals = task.sub_goals(values, tip)
    if not goals:
        return Label("none", np.zeros(3), True)
    try:
        plan = optimise(dynamics, task, dynamics.start(values, tip), settings)
    except SolveError as error:
        way = goals[0].tip_position - tip
        length = max(float(np.linalg.norm(way)), 1e-9)
        return Label(goals[0].name, way * min(1.0, goals[0].max_step / length), False, str(error))
    if not len(plan.actions):  # all goals are within their tolerances
        return Label("none", np.zeros(3), True)
    return Label(plan.sub_goals[0], plan.actions[0], plan.why_stopped != "out_of_reach")
