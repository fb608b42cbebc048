"""The tool arm of a simulated world, moved as an action says: for what acts on a world without ROS."""

from __future__ import annotations

import numpy as np

from samrl_core.cell.control.cartesian import HORIZON_S, LEASH
from samrl_core.cell.control.tip_sense import TipSense
from samrl_core.cell.control.touch_stop import TouchStop, TouchStopSettings
from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks.start import DOWN
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.world import SimulatedWorld

RAMP_S = 0.05  # a guarded motion's speed rises and falls in this time [s]


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


def move_until_touch(
    world: SimulatedWorld, model: ArmModel, start: np.ndarray, end: np.ndarray, speed: float, touch: TouchStop
) -> float:
    """Guarded motion of the tool arm at 1 kHz, `speed` of the way per second; the share that is done."""
    place = rate = 0.0
    most, stop_ns = speed / RAMP_S, -1
    while True:
        braking = rate * rate / (2.0 * most) >= 1.0 - place or 0 <= stop_ns <= world.time_ns
        change = -min(most, rate * 1e3) if braking else min(most, (speed - rate) * 1e3)
        rate += change * 1e-3
        place = min(place + rate * 1e-3, 1.0)
        q, dq, ddq = start + place * (end - start), rate * (end - start), change * (end - start)
        effort = model.effort_without_gravity(q, dq, ddq)
        world.command("tool_arm", ArmCommand(world.time_ns, q, dq, ddq, effort))
        world.advance()
        if braking and rate <= 0.0:
            return place
        if stop_ns < 0 and touch.feels(world.read_arm("tool_arm")):
            stop_ns = world.time_ns + round(HORIZON_S * 1e9)  # what was commanded by then is done


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
        self._sense = TipSense(cell, tool)
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
        target, end = self._end_of(displacement)
        move_joints(self._world, self._model, self._commanded, end, self._steps)
        self._target, self._commanded = target, end

    def touch_down(self, displacement: np.ndarray) -> None:
        """Move it slowly by (3,) [m], or until it touches: see `TouchStop`.

        Raises:
            ReachError: the arm does not get there; nothing has moved.
            InputError: the displacement has no length.
        """
        settings = TouchStopSettings()
        touch = TouchStop(self._sense, displacement, settings)
        target, end = self._end_of(displacement)
        speed = settings.speed / float(np.linalg.norm(displacement))
        done = move_until_touch(self._world, self._model, self._commanded, end, speed, touch)
        self._target = self._target + done * (target - self._target)
        self._commanded = self._commanded + done * (end - self._commanded)

    def rest(self) -> None:
        """Stand still for the time of an action."""
        for _ in range(self._steps):
            self._world.advance()

    def _end_of(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tip (3,) [m] and the joints (J,) [rad] that are commanded next."""
        tip = self.tip()
        lead = self._target + displacement - tip
        target = tip + lead * min(1.0, LEASH / max(float(np.linalg.norm(lead)), LEASH))
        flange = Pose.from_rotation(target, DOWN) @ self._tip_in_flange.inverse()
        return target, solve_ik(self._model, flange, self._commanded)

    def _tip_at(self, joint_position: np.ndarray) -> np.ndarray:
        return (self._model.flange_in_base(joint_position) @ self._tip_in_flange).position
