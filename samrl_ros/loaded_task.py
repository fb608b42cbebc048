"""A task whose tool carries a known extra load, for recordings that are made at two loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from samrl_core.robots.robot import CellSpec
from samrl_core.tasks.task import ParameterSpec, SubGoal, Task, ViewRegion
from samrl_core.types.pose import Pose
from samrl_core.types.scene import Scene


class LoadedTask(Task):
    """The given task with a tool of another mass, centre of mass and inertia unchanged."""

    def __init__(self, task: Task, tool_mass: float) -> None:
        self._task, self._tool_mass = task, tool_mass
        self.name, self.max_actions = task.name, task.max_actions

    def scene(self, cell: CellSpec) -> Scene:
        """See `Task`; the tool weighs `tool_mass` [kg]."""
        scene = self._task.scene(cell)
        return replace(scene, tool=replace(scene.tool, mass=self._tool_mass))

    def parameters(self) -> tuple[ParameterSpec, ...]:
        """See `Task`."""
        return self._task.parameters()

    def body_poses(self, values: np.ndarray) -> dict[str, Pose]:
        """See `Task`."""
        return self._task.body_poses(values)

    def start_joints(self, cell: CellSpec) -> dict[str, np.ndarray]:
        """See `Task`."""
        return self._task.start_joints(cell)

    def view_region(self) -> ViewRegion:
        """See `Task`."""
        return self._task.view_region()

    def sub_goals(self, values: np.ndarray, tip_position: np.ndarray) -> tuple[SubGoal, ...]:
        """See `Task`."""
        return self._task.sub_goals(values, tip_position)

    def is_done(self, values: np.ndarray, tip_position: np.ndarray) -> bool:
        """See `Task`."""
        return self._task.is_done(values, tip_position)

    def draw(self, rng: np.random.Generator) -> dict[str, Pose]:
        """See `Task`."""
        return self._task.draw(rng)

    def succeeded(self, body_position: dict[str, np.ndarray], tip_position: np.ndarray) -> bool:
        """See `Task`."""
        return self._task.succeeded(body_position, tip_position)

    def final_error(self, body_position: dict[str, np.ndarray], tip_position: np.ndarray) -> float:
        """See `Task`."""
        return self._task.final_error(body_position, tip_position)
