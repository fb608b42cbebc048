"""View targets, tool actions and trajectories in; checked, jerk-limited joint commands for both arms out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from samrl_msgs.msg import MotionStatus, ToolAction

from samrl_core.cell.control.cartesian import (
    ACTION_S,
    HORIZON_S,
    LEASH,
    LONGEST_DISPLACEMENT,
    straight_line,
)
from samrl_core.cell.control.guard import CommandGuard
from samrl_core.cell.control.tip_sense import TipSense
from samrl_core.cell.control.touch_stop import TOUCH_DOWN, TouchStop, TouchStopSettings
from samrl_core.cell.control.trajectory_rules import TrajectoryPoint, check_trajectory
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.cell.types.pose import Pose
from samrl_core.common.errors import InputError, LimitError, ReachError
from samrl_ros.contract.behaviour import Behaviour, Outbox
from samrl_ros.contract.settings import OUTLASTS_STOPS, setting
from samrl_ros.contract.topics import arm_topic, cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.nodes.arm_motion import ArmMotion, MotionEnd, MotionSettings
from samrl_ros.nodes.standstill import ESTOP, STOPPED, stopped_arms

TARGET, ACTION = cell_topic("view_planner/target"), cell_topic("policy/nominal_action")
EXECUTED, SAFETY = cell_topic("manipulator/executed_action"), cell_topic("safety_state")
JOINTS = {arm_topic(role, "joint_states"): role for role in ROLES}
TRAJECTORY = {arm_topic(role, "joint_trajectory"): role for role in ROLES}


@dataclass(frozen=True)
class ManipulatorSettings:
    """Settings of `manipulator`."""

    task: str = setting(DEFAULT_TASK, "task whose tool is held")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    max_velocity_scaling: float = setting(0.4, "fraction of the joint velocity limits", range=(0.01, 1.0))
    max_acceleration_scaling: float = setting(0.4, "fraction of the acceleration limits", range=(0.01, 1.0))
    max_jerk_scaling: float = setting(0.2, "fraction of the jerk limits", range=(0.01, 1.0))
    stopped_velocity_tolerance: float = setting(0.01, "at rest below this", "rad/s", (1e-4, 0.1))
    goal_timeout: float = setting(1.5, "longest wait for rest after the set point arrived", "s", (0.05, 60.0))
    horizon: float = setting(
        HORIZON_S, "how far ahead of a reading its command is stamped", "s", (0.004, 0.1)
    )
    leash: float = setting(LEASH, "commanded tool position may lead the measured one by", "m", (1e-3, 0.1))
    waypoint_spacing: float = setting(0.005, "of the straight line of an action", "m", (5e-4, 0.05))
    action_duration: float = setting(
        ACTION_S,
        "a short action takes so long at least, as in the model; a touch in half the time hits twice as hard",
        "s",
        (0.0, 5.0),
    )
    task_action_limit: float = setting(
        LONGEST_DISPLACEMENT, "longest displacement accepted", "m", (1e-3, 0.2)
    )
    touch_speed: float = setting(
        TouchStopSettings.speed,
        "speed of a guarded motion, which ends where the tool touches",
        "m/s",
        (1e-3, 0.05),
    )
    touch_rise: float = setting(
        TouchStopSettings.rise, "rise of the force along it that is a touch", "N", (0.1, 100.0)
    )
    heed_stops: bool = setting(
        OUTLASTS_STOPS,
        "an arm that its command guard stopped gives up its motion at once; false as it once did",
    )


class Manipulator(Behaviour):
    """Inverse kinematics, smoothing and the command guard, ticking on joint states."""

    name = "manipulator"
    inputs = (TARGET, ACTION, SAFETY, *JOINTS, *TRAJECTORY)
    outputs = (EXECUTED, *(arm_topic(r, n) for r in ROLES for n in ("command", "motion_status")))

    def __init__(self, settings: ManipulatorSettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        cell = cell_named(settings.cell)
        tool = task_named(settings.task).scene(cell).tool
        self._tip_in_flange = tool.tip_in_flange
        self._sense = TipSense(cell, tool)
        self._touch = TouchStopSettings(settings.touch_speed, settings.touch_rise)
        motion = MotionSettings(
            settings.max_velocity_scaling,
            settings.max_acceleration_scaling,
            settings.max_jerk_scaling,
            settings.stopped_velocity_tolerance,
            settings.goal_timeout,
            round(settings.horizon * 1e9),
        )
        payloads = nominal_payloads(cell, tool)
        self._arms = {r: ArmMotion(cell.arm(r), cell.base_in_world(r), payloads[r], motion) for r in ROLES}
        self._guards = {r: CommandGuard(cell.arm(r).limits, cell.arm(r).joint_names) for r in ROLES}
        self._ids: dict[str, tuple[int, int]] = dict.fromkeys(ROLES, (0, 0))
        self._action: tuple[Any, np.ndarray] | None = None  # request and tip before it
        self._taken: tuple[int, ...] = ()  # the newest action begun or done, see `_place`
        self._taken_ns = 0  # when it began
        self._stopped: tuple[str, ...] = ()  # arms that the guard has stopped until a reset
        self._estopped = False
        self._reset_ns = -1  # when the newest emergency stop was reset
        self._rejected = 0

    def handle(self, topic: str, message: Any) -> None:
        """See `Behaviour`."""
        if topic in JOINTS:
            self._tick(JOINTS[topic], message)
        elif topic == SAFETY:
            if self._settings.heed_stops:
                self._on_safety(message)
        elif topic == ACTION and self._is_repeated(message):
            self._outbox.log("warn", f"action {message.step} was asked for twice; it is done once")
        else:
            role = "tool_arm" if topic == ACTION else "camera_arm" if topic == TARGET else TRAJECTORY[topic]
            if topic in (ACTION, TARGET):
                self._ids[role] = (message.episode, message.step)
            try:
                if topic == ACTION:
                    self._on_action(message)
                elif topic == TARGET:
                    self._on_target(message)
                else:
                    self._on_trajectory(role, message)
            except (InputError, LimitError, ReachError) as error:
                self._rejected += 1
                self._outbox.log("error", f"{role}: rejected: {error}")
                self._report(role, MotionStatus.REJECTED, f"rejected: {error}", None)

    def status(self) -> dict[str, str]:
        """See `Behaviour`."""
        return {
            **{f"{role}_moving": str(arm.busy).lower() for role, arm in self._arms.items()},
            "rejected": str(self._rejected),
        }

    def _tick(self, role: str, message: Any) -> None:
        arm = self._arms[role]
        reading = from_message.arm_reading(message, arm.spec.joint_names)
        if role in self._stopped:
            if arm.stand(reading):
                self._give_up(role, "stopped by the command guard: motion given up")
            return
        command, end, void = arm.tick(reading)
        if void:
            self._give_up(role, "joint states paused: motion given up")
        if command is not None:
            # The same library that the bridge applies: a set point that it refuses is never sent.
            self._guards[role].check(command, reading)
            topic = arm_topic(role, "command")
            self._outbox.publish(topic, to_message.command(command, arm.spec.joint_names))
        if end is not None:
            self._on_end(role, end)

    def _give_up(self, role: str, reason: str) -> None:
        if role == "tool_arm":
            self._action = None
        self._report(role, MotionStatus.STOPPED, reason, None)

    def _on_safety(self, message: Any) -> None:
        """The set points must not run away from what the guards brake; late answers move nothing later."""
        self._stopped = stopped_arms(message, STOPPED)
        estopped = bool(stopped_arms(message, (ESTOP,)))
        if self._estopped and not estopped:
            self._reset_ns = max(self._now_ns(role) for role in ROLES)
        self._estopped = estopped

    def _place(self, action: Any) -> tuple[int, ...]:
        """Episode, step, and how often the arm was set to where it is: what was cut off may come again."""
        return (action.episode, action.step, self._arms["tool_arm"].stands)

    def _is_repeated(self, action: Any) -> bool:
        """Whether it is the one under way, or answers what was seen before that one.

        Episode and step do not tell: a supervisor that was started anew counts them from 0 once more.
        """
        if self._place(action) != self._taken:
            return False
        return self._action is not None or from_message.stamp_ns(action) <= self._taken_ns

    def _refuse_stale(self, message: Any) -> None:
        if from_message.stamp_ns(message) < self._reset_ns:
            raise InputError("it answers an image from before the emergency stop's reset")

    def _on_end(self, role: str, end: MotionEnd) -> None:
        if end.reached:
            self._report(role, MotionStatus.REACHED, "reached", end)
        else:
            limit = self._settings.goal_timeout
            text = f"not at rest {limit:g} s after the set point arrived"
            self._report(role, MotionStatus.TIMEOUT, text, end)
        if role == "tool_arm" and self._action is not None:
            request, tip_before = self._action
            self._action = None
            executed = ToolAction(header=to_message.header(self._now_ns(role)), episode=request.episode)
            executed.step, executed.sub_goal = request.step, request.sub_goal
            executed.nominal, executed.residual = request.nominal, request.residual
            executed.executed = to_message.vector(self._tip() - tip_before)
            self._outbox.publish(EXECUTED, executed)

    def _on_target(self, message: Any) -> None:
        if message.move:
            arm = self._ready("camera_arm")
            self._refuse_stale(message)
            arm.move([np.asarray(message.joint_position, dtype=np.float64)])

    def _on_action(self, message: Any) -> None:
        arm = self._ready("tool_arm")
        self._refuse_stale(message)
        displacement = from_message.vector(message.nominal) + from_message.vector(message.residual)
        length, limit = float(np.linalg.norm(displacement)), self._settings.task_action_limit
        if not np.isfinite(length) or length > limit:
            raise LimitError(f"tool displacement {length:.4f} m, limit {limit:.4f} m; ask for a shorter one")
        tip = self._tip()
        start, spacing = self._leashed(tip), self._settings.waypoint_spacing
        guarded = message.sub_goal == TOUCH_DOWN
        waypoints = straight_line(
            lambda flange_in_base, seed: solve_ik(arm.model, flange_in_base, seed),
            start,
            displacement,
            arm.commanded,
            max(length, spacing) if guarded else spacing,
        )
        if guarded:
            touch = TouchStop(self._sense, displacement, self._touch)
            arm.move(waypoints, length / self._touch.speed, touch)
        else:
            arm.move(waypoints, self._settings.action_duration)
        self._action = (message, tip)
        self._taken, self._taken_ns = self._place(message), self._now_ns("tool_arm")

    def _on_trajectory(self, role: str, message: Any) -> None:
        arm = self._ready(role)
        points = [
            TrajectoryPoint(
                np.asarray(p.positions, dtype=np.float64),
                np.asarray(p.velocities, dtype=np.float64),
                np.asarray(p.accelerations, dtype=np.float64),
                int(p.time_from_start.sec) * 1_000_000_000 + int(p.time_from_start.nanosec),
            )
            for p in message.points
        ]
        accepted = check_trajectory(
            list(message.joint_names),
            points,
            expected_names=arm.spec.joint_names,
            limits=arm.spec.limits,
            now_ns=self._now_ns(role),
            stamp_ns=from_message.stamp_ns(message),
            present_position=arm.commanded,
        )
        arm.move([p.position for p in accepted])

    def _ready(self, role: str) -> ArmMotion:
        if self._arms[role].reading is None:
            raise InputError(f"no joint state of {role} yet; start its driver first")
        if role in self._stopped:
            raise InputError(f"the command guard has stopped {role}; reset it first")
        return self._arms[role]

    def _leashed(self, measured_tip: np.ndarray) -> Pose:
        """Commanded flange pose, its tip at most `leash` from the measured tip: no wind-up in contact."""
        arm = self._arms["tool_arm"]
        flange = arm.model.flange_in_base(arm.commanded)
        lead = (flange @ self._tip_in_flange).position - measured_tip
        length, leash = float(np.linalg.norm(lead)), self._settings.leash
        excess = lead * max(0.0, 1.0 - leash / length) if length > 0 else lead
        return Pose(flange.position - excess, flange.quat_xyzw)

    def _tip(self) -> np.ndarray:
        arm = self._ready("tool_arm")
        assert arm.reading is not None
        return (arm.model.flange_in_base(arm.reading.position) @ self._tip_in_flange).position

    def _now_ns(self, role: str) -> int:
        reading = self._arms[role].reading
        return reading.stamp_ns if reading is not None else 0

    def _report(self, role: str, status: int, text: str, end: MotionEnd | None) -> None:
        episode, step = self._ids[role]
        header = to_message.header(self._now_ns(role))
        message = MotionStatus(header=header, arm=role, episode=episode, step=step)
        message.status, message.message = status, text
        if end is not None:
            message.duration, message.tracking_error = end.duration_s, end.tracking_error
        self._outbox.publish(arm_topic(role, "motion_status"), message)
