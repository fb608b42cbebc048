"""What contact says of a thing that has gone in: it leaves only on the way that it came.

An image that does not fit well, or a belief along the view that is too sure of itself, shows a thread beside
its eye that hangs in it deeply. Taken at its word it would be pulled out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.model.real2sim.real2sim import Estimate

_GATE = 9.0  # squared distance from what contact allows beyond which the image is believed [deviations]
_DIFFERENCE = 1e-6  # of a value, for the derivative of the aim [its unit]


def held_inside(task: Task, predicted: Estimate, after: Estimate, tip: np.ndarray) -> Estimate:
    """An update by an image, brought back to where contact holds what the prediction has inside.

    The aim that `Task.held_within` bounds is taken for a measurement of zero whose deviation is half of the
    bound, a disc's, where the update exceeds it (a bound on the state of a Kalman filter: Simon 2010). An
    update that states three deviations or more between the two is believed: the thread was not inside.

    Args:
        task: whose aim is bounded.
        predicted: before the image, at `tip`.
        after: the update by the image.
        tip: (3,) of the tool in the tool arm's base frame [m].
    """
    most = task.held_within(predicted.values, tip)
    if not np.isfinite(most):
        return after
    aim = task.aim(after.values, tip)
    if np.linalg.norm(aim) <= most:
        return after
    steps = _DIFFERENCE * np.eye(len(after.values))
    ends = [task.aim(after.values + h, tip) - task.aim(after.values - h, tip) for h in steps]
    jacobian = np.array(ends).T / (2.0 * _DIFFERENCE)
    told = jacobian @ after.covariance
    spread = told @ jacobian.T + (0.5 * most) ** 2 * np.eye(len(aim))
    if float(aim @ np.linalg.solve(spread, aim)) > _GATE:
        return after
    gain = np.linalg.solve(spread, told).T
    lower, upper = np.array([(p.lower, p.upper) for p in task.parameters()]).T
    covariance = after.covariance - gain @ told
    values = np.clip(after.values - gain @ aim, lower, upper)
    return replace(after, values=values, covariance=0.5 * (covariance + covariance.T))
