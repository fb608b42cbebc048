"""Pushes a thing along a line with a force, as an arm's driver would, and records what drivers know.

The arm keeps its impedance controller. Its reference is the point of a straight joint path that is
level with where it is, at the speed that it has: so it is held across the line and free along it, and the
force is feed-forward torque. No clock but the world's, no truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from samrl_core.cell.robots.arm_model import ArmModel, Payload
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.robots.tip_dynamics import TipDynamics
from samrl_core.cell.types.observation import ArmCommand
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.types.scene import Tool
from samrl_core.cell.world.pose_sensor import PoseSensor
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError, LimitError
from samrl_core.model.physical_parameters.push_record import PushRecord

ALONG = np.array([1.0, 0.0, 0.0])  # the line, in the tool arm's base
KNOT_SPACING = 0.01  # of the joint path [m]


@dataclass(frozen=True)
class PushSettings:
    """Course of a push.

    Raises:
        InputError: a time, force or length is not positive.
    """

    push_s: float = 0.15  # the force acts so long (the paper's T1) [s]
    total_s: float = 0.45  # and the thing is watched so long (the paper's T2) [s]
    ramp_s: float = 0.01  # the force grows so long: drives limit the rate of torque [s]
    brake_force: float = 12.0  # against the motion afterwards [N]
    stop_speed: float = 0.02  # below it the arm holds its position [m/s]
    sight_period_s: float = 1.0 / 30.0  # of the camera [s]
    reach: float = 0.18  # length of the line [m]
    touch_above_tip: float = 0.0025  # where on the blade the thing is touched [m]

    def __post_init__(self) -> None:
        for name in ("push_s", "ramp_s", "brake_force", "stop_speed", "sight_period_s", "reach"):
            if not getattr(self, name) > 0:
                raise InputError(f"{name} is {getattr(self, name)}, must be positive")
        if not self.total_s > self.push_s:
            raise InputError(f"total_s {self.total_s} s must exceed push_s {self.push_s} s")


class PushDriver:
    """Pushes with the tool of a cell's tool arm, whose base stands at the world's origin."""

    def __init__(self, cell: CellSpec, tool: Tool, settings: PushSettings | None = None) -> None:
        """The arm's dynamics are the nominal ones with the tool as payload."""
        self._cell, self._tool, self.settings = cell, tool, settings or PushSettings()
        load = Payload(tool.mass, tool.center_of_mass, tool.inertia)
        self._arm = ArmModel(cell.tool_arm, cell.tool_base_in_world, load)
        touch = Pose(np.array([0.0, 0.0, -self.settings.touch_above_tip]), Pose.identity().quat_xyzw)
        self._touch_in_flange = tool.tip_in_flange @ touch
        self._tip = TipDynamics(self._arm, self._touch_in_flange, ALONG)

    def push(self, world: SimulatedWorld, force: float, sensor: PoseSensor) -> PushRecord:
        """One push from the arm's present position, at rest.

        Args:
            world: advanced by `total_s`.
            force: along the line while the push lasts [N].
            sensor: sees what is pushed.

        Raises:
            InputError: the force is not positive.
            LimitError: the tip has come to the end of its line; push shorter or softer.
        """
        if not (np.isfinite(force) and force > 0):
            raise InputError(f"force {force} N must be positive and finite")
        s, period = self.settings, self._cell.tool_arm.controller.period_s
        steps, push_steps = round(s.total_s / period), round(s.push_s / period)
        sights = np.arange(0.0, s.total_s + 0.5 * period, s.sight_period_s) / period
        seen_step = np.unique(np.rint(sights).astype(int))
        path = self._joint_path(world.read_arm("tool_arm").position)
        rate, zero = path.derivative(), np.zeros(len(self._cell.tool_arm.joint_names))
        rows, observed = np.zeros((steps, 3)), []
        stopped_at: float | None = None
        for k in range(steps):
            if k in seen_step:
                observed.append(float(sensor.read() @ ALONG))
            reading = world.read_arm("tool_arm")
            q, dq = reading.position, reading.velocity
            gradient = self._tip.gradient(q)
            position, speed = float(self._tip.position(q) @ ALONG), float(gradient @ dq)
            if not path.x[0] <= position <= path.x[-1]:
                raise LimitError(
                    f"the tip is at {position:.3f} m, beyond its line {path.x[0]:.3f}..{path.x[-1]:.3f} m; "
                    f"push with less force than {force} N or for less than {s.push_s} s"
                )
            if k < push_steps:
                wanted = force * min(1.0, (k + 1) * period / s.ramp_s)
            elif stopped_at is None and speed > s.stop_speed:
                wanted = -s.brake_force
            else:
                stopped_at, wanted = position if stopped_at is None else stopped_at, 0.0
            level, pace = (position, speed) if stopped_at is None else (stopped_at, 0.0)
            goal = ArmCommand(world.time_ns, path(level), rate(level) * pace, zero, gradient * wanted)
            world.command("tool_arm", goal)
            world.advance()
            torque = world.commanded_effort("tool_arm")
            rows[k] = position, self._tip.free_acceleration(q, dq, torque), self._tip.effective_mass(q)
        if seen_step[-1] == steps:
            observed.append(float(sensor.read() @ ALONG))
        tip, free, mass = rows.T
        return PushRecord(period, push_steps, tip, free, mass, seen_step, np.array(observed))

    def _joint_path(self, start: np.ndarray) -> CubicSpline:
        """Joints (J,) [rad] over the position along the line [m], with constant tool orientation."""
        first = self._arm.flange_in_base(start) @ self._touch_in_flange
        ahead = np.arange(-KNOT_SPACING, self.settings.reach, KNOT_SPACING)
        joints, q = [], start
        for way in ahead:
            pose = Pose(first.position + way * ALONG, first.quat_xyzw)
            q = solve_ik(self._arm, pose @ self._touch_in_flange.inverse(), q, tolerance=1e-8)
            joints.append(q)
        return CubicSpline(float(first.position @ ALONG) + ahead, np.array(joints))
