"""How far the tool gives way: the arm's impedance controller as springs at the tool's tip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task


@dataclass(frozen=True, eq=False)
class GripCompliance:
    """Springs along and about the tool arm's base axes, at the tip; the spin about z is left out."""

    along: np.ndarray  # (3,) [N/m]
    about: np.ndarray  # (2,) of x and y [N m/rad]


def grip_of(task: Task, cell: CellSpec) -> GripCompliance:
    """The compliance J K^-1 J^T of the arm in the task's start pose; what couples its axes is left out."""
    arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, None)
    joints = task.start_joints(cell)["tool_arm"]
    jacobian = arm.jacobian(joints)
    lever = arm.flange_in_base(joints).rotation @ task.scene(cell).tool.tip_in_flange.position
    linear = jacobian[:3] + np.cross(jacobian[3:].T, lever).T
    whole = np.vstack([linear, jacobian[3:]])
    give = np.einsum("ij,j,ij->i", whole, 1.0 / cell.tool_arm.controller.stiffness, whole)
    return GripCompliance(1.0 / give[:3], 1.0 / give[3:5])
