"""Eq. 3 of an upright peg and a ring of boxes in closed form: no time, no forces, a thousand times faster."""

from __future__ import annotations

import numpy as np
import torch

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.start import checked_tip
from samrl_core.cell.tasks.task import Task
from samrl_core.common.errors import InputError
from samrl_core.model.task_dynamics import peg_contact
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics, TaskState


class PegDynamics(TaskDynamics):
    """The tip, stopped and guided by one upright ring that the parameters move.

    The coordinates are the tip's and the values; a ring does not move by itself.

    Args:
        task: its parameters move one body, along the table.
        cell: the tool arm's base is the world's origin.
        table_height: z of the table [m].

    Raises:
        InputError: tool and body are no upright peg and ring.
    """

    def __init__(self, task: Task, cell: CellSpec, table_height: float = 0.0) -> None:
        self._task, self._table = task, table_height
        nominal = np.array([p.nominal for p in task.parameters()])
        scene = task.scene(cell)
        moved = list(task.body_poses(nominal))
        bodies = [body for body in scene.bodies if body.name in moved]
        if len(bodies) != 1 or scene.tool.chain:
            raise InputError(f"task {task.name} moves {moved} with its tool; only one ring has a closed form")
        self._sizes = peg_contact.sizes_from(scene.tool, bodies[0])
        self._name = bodies[0].name
        # Linear in the values: differences are exact but for rounding.
        origin = self._origin(nominal)
        columns = [self._origin(nominal + step) - origin for step in np.eye(len(nominal))]
        self._jacobian = torch.from_numpy(np.stack(columns, axis=1))
        self._offset = torch.from_numpy(origin) - self._jacobian @ torch.from_numpy(nominal)

    def prepare(self) -> None:
        """Nothing is compiled."""

    def start(self, values: np.ndarray, tip_position: np.ndarray) -> TaskState:
        """See `TaskDynamics`."""
        tip = checked_tip(tip_position)
        rows = np.atleast_2d(np.asarray(values, dtype=np.float64))
        for one in rows:
            self._task.body_poses(one)  # refuses wrong shapes and non-finite numbers
        q = np.hstack([np.tile(tip, (len(rows), 1)), rows])
        nothing = torch.zeros((len(rows), 0), dtype=torch.float64)
        return TaskState(torch.from_numpy(q), nothing, nothing)

    def forward(self, state: TaskState, action: torch.Tensor) -> TaskState:
        """See `TaskDynamics`."""
        batch = state.q.shape[0]
        if tuple(action.shape) != (batch, 3):
            raise InputError(f"action has shape {tuple(action.shape)}, must be ({batch}, 3): one per state")
        tips = []
        for q, one in zip(state.q, action, strict=True):
            origin = self._jacobian @ q[3:] + self._offset
            tips.append(peg_contact.step(q[:3], one, origin, self._sizes, self._table))
        return TaskState(torch.cat([torch.stack(tips), state.q[:, 3:]], dim=1), state.v, state.rest)

    def read(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `TaskDynamics`."""
        return q[3:], q[:3]

    def _origin(self, values: np.ndarray) -> np.ndarray:
        """Of an upright ring with its mouth where the estimate has it, also for one that leans."""
        mouth = np.array([0.0, 0.0, self._sizes.top])
        return self._task.body_poses(values)[self._name].apply(mouth) - mouth
