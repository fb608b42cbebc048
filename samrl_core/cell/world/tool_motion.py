"""The tool arm of a simulated world, moved as an action says: for what acts on a world without ROS."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.control.cartesian import LEASH
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.start import DOWN
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.world import SimulatedWorld


def move_joints(
    world: SimulatedWorld, model: ArmModel, start: np.ndarray, end: np.ndarray, steps: int
) -> None:
    """Minimum-jerk motion of the tool arm at 1 kHz with nominal feed-forward, over `steps` periods."""
    duration = steps * 1e-3
    for i in range(1, steps + 1):
        s = i / steps
        place = 10 * s**3 - 15 * s**4 + 6 * s**5
        speed = (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
        rate = (60 * s - 180 * s**2 + 120 * s**3) / duration**2
        q, dq, ddq = start + place * (end - start), speed * (end - start), rate * (end - start)
        effort = model.effort_without_gravity(q, dq, ddq)
        world.command("tool_arm", ArmCommand(world.time_ns, q, dq, ddq, effort))
        world.advance()


class ToolMotion:
    """Displaces the tool's tip, rotation fixed; reads nothing but joint sensors.

    Call `begin` after each reset of the world.
    """

    def __init__(self, world: SimulatedWorld, task: Task, cell: CellSpec, period_s: float) -> None:
        """`period_s` is the time of an action [s]."""
        tool = task.scene(cell).tool
        load = Payload(tool.mass, tool.center_of_mass, tool.inertia)
        self._world = world
        self._model = ArmModel(cell.tool_arm, cell.tool_base_in_world, load)
        self._tip_in_flange = tool.tip_in_flange
        self._steps = round(period_s * 1e3)
        self.begin()

    def begin(self) -> None:
        """Commands go on from where the arm is."""
        self._commanded = self._world.read_arm("tool_arm").position
        self._target = self._tip_at(self._commanded)

    def tip(self) -> np.ndarray:
        """Measured tip (3,) in the tool arm's base frame [m]."""
        return self._tip_at(self._world.read_arm("tool_arm").position)

    def displace(self, displacement: np.ndarray) -> None:
        """Move the commanded tip by (3,) [m] in the base frame; it leads the measured one by `LEASH` at most.

        Raises:
            ReachError: the arm does not get there; nothing has moved.
        """
        tip = self.tip()
        lead = self._target + displacement - tip
        target = tip + lead * min(1.0, LEASH / max(float(np.linalg.norm(lead)), LEASH))
        flange = Pose.from_rotation(target, DOWN) @ self._tip_in_flange.inverse()
        end = solve_ik(self._model, flange, self._commanded)
        move_joints(self._world, self._model, self._commanded, end, self._steps)
        self._target, self._commanded = target, end

    def rest(self) -> None:
        """Stand still for the time of an action."""
        for _ in range(self._steps):
            self._world.advance()

    def _tip_at(self, joint_position: np.ndarray) -> np.ndarray:
        return (self._model.flange_in_base(joint_position) @ self._tip_in_flange).position
