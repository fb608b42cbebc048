"""Which dynamics a task has."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.model.task_dynamics.peg_dynamics import PegDynamics
from samrl_core.model.task_dynamics.rigid_task_dynamics import TaskPhysics
from samrl_core.model.task_dynamics.settings import TaskPhysicsSettings
from samrl_core.model.task_dynamics.task_dynamics import TaskDynamics


def dynamics_of(task: Task, cell: CellSpec, settings: TaskPhysicsSettings | None = None) -> TaskDynamics:
    """The closed form where all that the parameters move is fixed to the table, the physics else.

    Args:
        task: its scene is built.
        cell: the arms.
        settings: of the physics; the closed form takes the table's height of them.

    Raises:
        InputError: the scene has parts that neither can move.
    """
    s = settings or TaskPhysicsSettings()
    scene = task.scene(cell)
    nominal = np.array([p.nominal for p in task.parameters()])
    moved = set(task.body_poses(nominal))
    free = any(body.mass > 0.0 for body in scene.bodies if body.name in moved)
    if free or scene.tool.chain:
        return TaskPhysics(task, cell, s)
    return PegDynamics(task, cell, s.contact.table_height)
