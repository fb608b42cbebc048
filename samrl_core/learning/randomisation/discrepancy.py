"""How far the model strays from what the cell was observed to do, for SimOpt.

The cell's trajectory is that of Real2Sim's estimates: no state is measured, images are. From each estimate
the model takes the action that was taken, and what it expects is compared with the next estimate. As Chebotar
et al. 2019 do, absolute and squared differences are weighted; each parameter counts in units of its prior's
spread.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.learning.randomisation.of_task import LOG, alike, dynamics_at
from samrl_core.learning.randomisation.space import Space
from samrl_core.learning.states.state_batch import joined, moved
from samrl_core.learning.states.visited import VisitedStates
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics

UNSOLVED = 10.0  # difference that counts for a motion that the model cannot follow [prior's spread]


@dataclass(frozen=True)
class DiscrepancySettings:
    """Weights of the two distances.

    Raises:
        InputError: a negative weight, or none above 0.
    """

    absolute: float = 1.0
    squared: float = 1.0

    def __post_init__(self) -> None:
        if min(self.absolute, self.squared) < 0.0 or max(self.absolute, self.squared) == 0.0:
            raise InputError(f"weights {self.absolute}, {self.squared} must be at least 0, and not both 0")


class Discrepancy:
    """Of the model at a point from recorded episodes."""

    def __init__(
        self,
        task: Task,
        dynamics: TaskDynamics,
        recorded: VisitedStates,
        settings: DiscrepancySettings | None = None,
    ) -> None:
        """Finds the actions between neighbouring steps.

        Raises:
            InputError: no two estimates with one action between them.
        """
        self._dynamics, self._settings = dynamics, settings or DiscrepancySettings()
        self._scale = np.array([spec.scale for spec in task.parameters()])
        order = np.lexsort((recorded.step, recorded.episode))
        rows = recorded.rows(order)
        follows = (np.diff(rows.episode) == 0) & (np.diff(rows.step) == 1)
        self._before = np.flatnonzero(follows)
        if not len(self._before):
            raise InputError(
                f"{len(recorded)} visited states hold no action between two estimates; record whole episodes"
            )
        self._rows = rows

    def __len__(self) -> int:
        """Actions that are compared."""
        return len(self._before)

    def at(self, space: Space, points: np.ndarray) -> np.ndarray:
        """(N,) of points (N, P).

        Raises:
            InputError: the space has no physical parameter.
        """
        if not space.columns(LOG):
            raise InputError(
                f"nothing of {space.names} moves the model; a discrepancy needs physical parameters"
            )
        found = np.empty(len(points))
        for rows in alike(space, points):
            found[rows] = self._of(dynamics_at(self._dynamics, space, points[rows]))
        return found

    def _of(self, dynamics: TaskDynamics) -> float:
        rows, k = self._rows, self._before
        start = joined([dynamics.start(rows.values[i], rows.tip_in_base[i]) for i in k])
        after, solved = moved(dynamics, start, rows.tip_in_base[k + 1] - rows.tip_in_base[k])
        expected = np.array([dynamics.read(q)[0] for q in after.q.numpy()])
        apart = (expected - rows.values[k + 1]) / self._scale
        apart[~solved] = UNSOLVED
        s = self._settings
        return float((s.absolute * np.abs(apart) + s.squared * apart**2).mean())
