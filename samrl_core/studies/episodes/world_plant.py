"""A simulated world as Algorithm 1's plant, without ROS: sensors and motions, and nothing of its truth."""

from __future__ import annotations

import math

import numpy as np

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import Observation
from samrl_core.cell.world.corrected_world import corrected_world
from samrl_core.cell.world.tool_motion import ToolMotion
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError
from samrl_core.model.task_dynamics.settings import TaskPhysicsSettings
from samrl_core.studies.episodes.cell_driver import CellDriver


class WorldPlant:
    """See `samrl_core.policy.agent.episode.Plant`."""

    def __init__(
        self,
        world: SimulatedWorld,
        task: Task,
        cell: CellSpec,
        period_s: float = TaskPhysicsSettings.action_s,
        rest_s: float = TaskPhysicsSettings.rest_s,
        correction: CellCorrection = NO_CORRECTION,
        think_s: float = 0.0,
    ) -> None:
        """`period_s` is the time of an action, `rest_s` that before an image, `think_s` that from an image to
        the action that follows from it, while the world goes on [s]; `correction` is what the cell is known
        to differ by from `cell`.

        Raises:
            InputError: a time that is negative or not finite.
        """
        if not 0.0 <= think_s < math.inf:
            raise InputError(f"think_s is {think_s} s, must be 0 or more and finite")
        self._world = world = corrected_world(world, correction, cell)
        cell = correction.cell(cell)
        self._driver = CellDriver(world, cell, task.scene(cell).tool, correction)
        self._motion = ToolMotion(world, task, cell, period_s)
        self._rest_steps, self._think_steps = round(rest_s * 1e3), round(think_s * 1e3)

    def begin(self, seed: int) -> None:
        """Lay the scene anew."""
        self._world.reset(seed)
        self._motion.begin()

    def tip(self) -> np.ndarray:
        """Tool tip (3,) by the measured joints, in the tool arm's base frame [m]."""
        return self._motion.tip()

    def observe(self) -> Observation:
        """See `Plant`: what swings comes to rest first."""
        self._advance(self._rest_steps)
        return self._driver.observe()

    def move_camera(self, camera_arm_position: np.ndarray) -> None:
        """See `Plant`."""
        self._driver.move("camera_arm", camera_arm_position)

    def displace_tool(self, displacement: np.ndarray) -> None:
        """See `Plant`.

        Raises:
            ReachError: the arm does not get there; it has not moved.
        """
        self._advance(self._think_steps)
        self._motion.displace(displacement)

    def touch_down(self, displacement: np.ndarray) -> None:
        """See `Plant`.

        Raises:
            ReachError: the arm does not get there; it has not moved.
        """
        self._advance(self._think_steps)
        self._motion.touch_down(displacement)

    def _advance(self, steps: int) -> None:
        for _ in range(steps):
            self._world.advance()
