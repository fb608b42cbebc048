"""The simulated cell behind driver-level topics, with no ROS host around it.

Time is advanced from outside, one controller period at a time. The command guard sits here, next to
the world, as it would sit in a hardware driver.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rosgraph_msgs.msg import Clock
from samrl_msgs.msg import EpisodeReady
from tf2_msgs.msg import TFMessage

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import Frame
from samrl_core.cell.world.corrected_world import corrected_world
from samrl_core.cell.world.evaluation import TruthLog
from samrl_core.cell.world.world import SimulatedWorld
from samrl_core.common.errors import InputError
from samrl_ros.contract.behaviour import Outbox
from samrl_ros.contract.topics import arm_topic, camera_topic, cell_topic
from samrl_ros.conversions import to_message
from samrl_ros.nodes.bridge.announcements import announce_cell
from samrl_ros.nodes.bridge.arm_guards import ArmGuards
from samrl_ros.nodes.bridge.transforms import OPTICAL_FRAME, dynamic_transforms, static_transforms
from samrl_ros.nodes.standstill import LATCHED

GRAVITY = (0.0, 0.0, -9.81)  # [m/s2] in world
_SETTLE_S = 0.3  # simulated before a new episode is announced; also a gap that tells nodes of the restart


@dataclass(frozen=True)
class BridgeRates:
    """Simulated rates of what is published."""

    joint_state_hz: int = 250
    camera_hz: int = 10
    tf_hz: int = 20


class BridgeCore:
    """Publishes sensors, takes commands, lays out episodes; `tick` advances one controller period."""

    def __init__(
        self,
        outbox: Outbox,
        world: SimulatedWorld,
        cell: CellSpec,
        task: Task,
        rates: BridgeRates,
        command_timeout_s: float,
        truth_log: TruthLog | None,
        steady_s: Callable[[], float],
        correction: CellCorrection = NO_CORRECTION,
    ) -> None:
        self._outbox = outbox
        self._world = corrected_world(world, correction, cell)
        self._cell = correction.cell(cell)  # as it is announced; the world has a truth of its own
        self._correction = correction
        self._task = task
        self._truth_log = truth_log
        self._period_ns = round(cell.tool_arm.controller.period_s * 1e9)
        self._every = {
            "joints": self._ticks(rates.joint_state_hz),
            "camera": self._ticks(rates.camera_hz),
            "tf": self._ticks(rates.tf_hz),
        }
        self.guards = ArmGuards(outbox, cell, command_timeout_s, steady_s)
        self._arms = {r: ArmModel(cell.arm(r), self._cell.base_in_world(r), None) for r in ROLES}
        self._ticks_done = 0
        self._frames: deque[tuple[int, Frame]] = deque()  # taken, and due to be handed out at [ns]
        self._episode = -1
        self._seed = 0

    def _ticks(self, hz: int) -> int:
        return max(1, round(1e9 / (hz * self._period_ns)))

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self._world.time_ns

    def announce(self) -> None:
        """Publish what late joiners need: descriptions, controllers, tools, calibration, static frames."""
        tool = self._task.scene(self._cell).tool
        announce_cell(self._outbox, self._cell, tool)
        for role in ROLES:
            controller = to_message.controller(self._cell.arm(role), GRAVITY)
            self._outbox.publish(arm_topic(role, "controller"), controller)
        transforms = static_transforms(self._cell, tool.tip_in_flange, self._world.time_ns)
        self._outbox.publish("/tf_static", TFMessage(transforms=transforms))
        self.guards.publish_safety()

    def on_command(self, role: str, message: Any, commander: str = "") -> None:
        """A message on `<arm>/command` of a commander."""
        self.guards.on_command(role, message, self._world.read_arm(role), self._robot_s, commander)

    def waits_for_commands(self, within_s: float) -> bool:
        """Whether simulated time should stand still: an arm's next commands are due and still under way."""
        return self.guards.waits_for_commands(self._robot_s, within_s)

    def tick(self) -> None:
        """One controller period: guard, controller, physics, then whatever is due to be published."""
        self._track_commands()
        self._world.advance()
        if self._ticks_done % self._every["joints"] == 0:
            self._publish_commanded(self._world.time_ns - self._period_ns)
        self._ticks_done += 1
        self._publish_due()

    def start_episode(self, episode: int, seed: int) -> None:
        """Lay the scene anew and announce it when the arms have been at rest for a while.

        A fault ends with the episode, for the arms are placed anew; an emergency stop is somebody's word.

        Raises:
            InputError: an emergency stop has not been reset.
        """
        if self.guards.is_estopped():
            raise InputError(LATCHED)
        self._world.reset(seed)
        for role in ROLES:
            self.guards.restart(role)
        for _ in range(round(_SETTLE_S * 1e9 / self._period_ns)):
            self._track_commands()
            self._world.advance()
        self._ticks_done = 0
        self._frames.clear()
        self._episode, self._seed = episode, seed
        if self._truth_log is not None:
            self._truth_log.record(episode, seed, "start")
        header = to_message.header(self._world.time_ns)
        ready = EpisodeReady(header=header, episode=episode, task=self._task.name)
        self._outbox.publish(cell_topic("sim_bridge/ready"), ready)
        self._publish_due()

    def end_episode(self, episode: int) -> None:
        """The supervisor has ended an episode: evaluation notes how things really are."""
        if self._truth_log is not None and episode == self._episode:
            self._truth_log.record(episode, self._seed, "end")

    def reset_safety(self) -> str:
        """Explicit reset of both arms, or of neither; returns why it was refused, empty when done."""
        return self.guards.reset({role: self._world.read_arm(role) for role in ROLES})

    @property
    def _robot_s(self) -> float:
        return self._world.time_ns * 1e-9

    def _track_commands(self) -> None:
        for role in ROLES:
            target = self.guards.tick(role, self._world.read_arm(role), self._robot_s)
            self._world.command(role, target)

    def _publish_commanded(self, stamp_ns: int) -> None:
        """What the controllers made of the states that were published with the same stamp."""
        for role in ROLES:
            message = to_message.effort_state(
                stamp_ns, self._world.commanded_effort(role), self._cell.arm(role).joint_names
            )
            self._outbox.publish(arm_topic(role, "commanded_effort"), message)

    def _publish_due(self) -> None:
        n = self._ticks_done
        if n % self._every["joints"] == 0:
            stamp = self._world.time_ns
            self._outbox.publish("/clock", Clock(clock=to_message.time(stamp)))
            for role in ROLES:
                names = self._cell.arm(role).joint_names
                self._outbox.publish(
                    arm_topic(role, "joint_states"), to_message.joint_state(self._world.read_arm(role), names)
                )
            self.guards.publish_safety()
        if n % self._every["tf"] == 0:
            positions = {role: self._world.read_arm(role).position for role in ROLES}
            transforms = dynamic_transforms(self._arms, positions, self._world.time_ns)
            self._outbox.publish("/tf", TFMessage(transforms=transforms))
        if n % self._every["camera"] == 0:
            due_ns = self._world.time_ns + self._world.camera_latency_ns
            self._frames.append((due_ns, self._world.read_camera()))
        while self._frames and self._frames[0][0] <= self._world.time_ns:
            self._publish_frame(self._frames.popleft()[1])

    def _publish_frame(self, frame: Frame) -> None:
        frame = self._correction.frame(frame, self._cell.intrinsics)
        messages = to_message.camera_frame(frame, self._cell.intrinsics, OPTICAL_FRAME)
        for name, message in messages.items():
            self._outbox.publish(camera_topic(name), message)
