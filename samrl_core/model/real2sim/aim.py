"""What a belief says of a task's aim, and when an image moves it farther than can be."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.tasks.task import Task

_DIFFERENCE = 1e-6  # of a value, for the derivative of the aim [its unit]


def aim_jacobian(task: Task, values: np.ndarray, tip: np.ndarray) -> np.ndarray:
    """Derivative (A, P) of `Task.aim` by the parameters, at values (P,) and tip (3,) [m]."""
    steps = _DIFFERENCE * np.eye(len(values))
    ends = [task.aim(values + h, tip) - task.aim(values - h, tip) for h in steps]
    return np.array(ends).T / (2.0 * _DIFFERENCE)


def aim_surprise(
    task: Task, before: np.ndarray, belief: np.ndarray, after: np.ndarray, tip: np.ndarray
) -> float:
    """How far the aim has moved, in deviations of what was believed of it; 0 of a task without an aim.

    Args:
        task: whose aim is asked for.
        before: mean of the belief (P,).
        belief: its covariance (P, P).
        after: values (P,) that an image says.
        tip: (3,) of the tool in the tool arm's base frame [m].
    """
    moved = task.aim(after, tip) - task.aim(before, tip)
    if not len(moved):
        return 0.0
    jacobian = aim_jacobian(task, before, tip)
    return float(np.sqrt(moved @ np.linalg.solve(jacobian @ belief @ jacobian.T, moved)))
