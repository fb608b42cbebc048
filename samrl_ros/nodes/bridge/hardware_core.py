"""The cell behind drivers' topics, with no ROS host around it: what the drivers say in, set points out.

Time is the drivers' own: robot time is the stamp of the newest joint state. Until the pre-flight has found
nothing against it, no joint state is passed on and no command taken; nothing can switch that off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from samrl_msgs.msg import EpisodeReady
from tf2_msgs.msg import TFMessage

from samrl_core.cell.calibration.cell_correction import NO_CORRECTION, CellCorrection
from samrl_core.cell.robots.arm_model import ArmModel
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.observation import ArmReading
from samrl_core.common.errors import InputError
from samrl_ros.contract.behaviour import Outbox
from samrl_ros.contract.topics import arm_topic, camera_topic, cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.hardware import adapter
from samrl_ros.hardware.camera_adapter import CameraAdapter
from samrl_ros.hardware.driver_file import DriverFile
from samrl_ros.hardware.observe import HeardSamples
from samrl_ros.hardware.preflight import cell_faults, clock_offsets, is_of
from samrl_ros.nodes.bridge.announcements import announce_cell
from samrl_ros.nodes.bridge.arm_guards import ArmGuards
from samrl_ros.nodes.bridge.operator_episodes import OperatorEpisodes
from samrl_ros.nodes.bridge.transforms import OPTICAL_FRAME, dynamic_transforms, static_transforms
from samrl_ros.nodes.standstill import LATCHED

READY = cell_topic("sim_bridge/ready")
_TF_PERIOD_NS = 50_000_000
# Without joint states before an episode: it tells the nodes that arms were moved by hand.
_GAP_NS = 150_000_000
# Of a topic on which others go on: the arm's driver has gone or names other joints.
_MISSED_NS = 1_000_000_000
_SMOOTHING = 0.01  # of the clock offsets' running mean


@dataclass(frozen=True)
class HardwareLimits:
    """How the border to the drivers behaves."""

    command_timeout_s: float
    lead_s: float  # set points are sent so far ahead of the joint state that they answer
    observe_only: bool  # nothing is ever sent to a driver
    judged: bool  # by the operator
    publish_tf: bool


class HardwareCore:
    """Converts, guards, lets an operator begin episodes; `send` takes part and message for a controller."""

    def __init__(
        self,
        outbox: Outbox,
        cell: CellSpec,
        task: Task,
        drivers: Mapping[str, DriverFile],
        limits: HardwareLimits,
        steady_s: Callable[[], float],
        send: Callable[[str, Any], None],
        correction: CellCorrection = NO_CORRECTION,
    ) -> None:
        correction.require_joints(cell)
        cell = correction.cell(cell)
        self._correction = correction
        self._outbox, self._cell, self._task, self._drivers = outbox, cell, task, drivers
        self._limits, self._send = limits, send
        self.guards = ArmGuards(outbox, cell, limits.command_timeout_s, steady_s)
        self.episodes = OperatorEpisodes(outbox, cell, task, limits.judged)
        self._camera = CameraAdapter(cell.intrinsics)
        self._arms = {role: ArmModel(cell.arm(role), cell.base_in_world(role), None) for role in ROLES}
        self._observed: HeardSamples | None = HeardSamples()  # during the pre-flight
        self._readings: dict[str, ArmReading] = {}  # newest of each arm, in our order
        self._passed_ns = dict.fromkeys(ROLES, -(10**18))  # stamp of the joint state passed on last
        self._silent_until_ns: dict[str, int] = {}  # stamps before this are not passed on
        self._tf_ns = -(10**18)
        self.refused = 0  # messages of drivers
        self.sent = 0  # set points
        self.offsets: dict[str, float] = {}  # [s] as `clock_offsets`

    @property
    def is_checking(self) -> bool:
        """Whether the pre-flight is under way, or has failed."""
        return self._observed is not None

    def announce(self) -> None:
        """Publish what late joiners need: descriptions, tools, calibration, static frames."""
        tool = self._task.scene(self._cell).tool
        announce_cell(self._outbox, self._cell, tool)
        if self._limits.publish_tf:
            transforms = static_transforms(self._cell, tool.tip_in_flange, 0)
            self._outbox.publish("/tf_static", TFMessage(transforms=transforms))
        self.guards.publish_safety()

    def has_heard_enough(self, seconds: float) -> bool:
        """Whether the pre-flight can be judged: each stream has been heard for so long, by its stamps [s]."""
        return self._observed is not None and self._observed.is_enough(self._drivers, seconds)

    def finish_preflight(self) -> list[str]:
        """What speaks against moving. Empty ends the pre-flight; so does anything, where nothing can move."""
        if self._observed is None:
            return []
        seen = self._observed
        faults = cell_faults(self._cell, self._drivers, seen.arms, seen.images)
        self.offsets = clock_offsets(seen.arms, seen.images)
        if self._limits.observe_only or not faults:
            self._observed = None
        return faults

    def watch_anew(self) -> None:
        """Forget what the pre-flight has heard, and ask once more: a busy start loses messages."""
        self._observed = HeardSamples()

    def hear(self, part: str, stream: str, message: Any, received_s: float) -> None:
        """A message of a driver, received at `received_s` by the clock that stamps are compared with."""
        driver = self._drivers[part]
        if self._observed is not None:
            self._observed.take(driver, part, stream, message, received_s)
            return
        if driver.kind == "arm" and not is_of(driver.joints or {}, message.name):
            self._miss_arm(part, message)
            return
        stamp_ns = from_message.stamp_ns(message)
        name = part if driver.kind == "arm" else stream
        offset = received_s - 1e-9 * stamp_ns
        self.offsets[name] = offset + (1 - _SMOOTHING) * (self.offsets.get(name, offset) - offset)
        try:
            if driver.kind == "arm":
                self._hear_arm(part, driver, message, stamp_ns)
            else:
                self._hear_camera(stream, message)
        except InputError as error:
            self.refused += 1
            self._outbox.log("error", f"{part}: refused a message of its driver: {error}")
            if driver.kind == "arm" and self.episodes.running >= 0:
                self.guards.fault(part, f"its driver said what cannot be used: {error}")

    def on_command(self, role: str, message: Any, commander: str) -> None:
        """A message on `<arm>/command`; outside episodes, and where nothing may move, it is dropped."""
        if self._may_move(role):
            self.guards.on_command(role, message, self._readings[role], self._robot_s(role), commander)

    def on_rivals(self, role: str, publishers: list[str]) -> None:
        """More than one commander."""
        if self._may_move(role):
            self.guards.on_rivals(role, publishers)

    def start_episode(self, episode: int) -> None:
        """Ask the operator for an episode's scene.

        Raises:
            InputError: nothing may move here, or an emergency stop has not been reset.
        """
        if self._limits.observe_only:
            raise InputError("this cell only observes; start it without observe_only to move")
        if self.guards.is_estopped():
            raise InputError(LATCHED)
        self.episodes.ask(episode)

    def begin_episode(self) -> None:
        """The operator says that the scene is ready.

        Raises:
            InputError: it may not begin; says why.
        """
        if self.is_checking:
            raise InputError("the pre-flight is not over; wait for it")
        if self.guards.is_estopped():
            raise InputError(LATCHED)
        self.episodes.begin(self._readings)
        for role in ROLES:
            self.guards.restart(role)
            self._silent_until_ns[role] = self._passed_ns[role] + _GAP_NS

    def end_episode(self, episode: int) -> None:
        """An outcome: what still moves brakes, as no command is taken any more."""
        if episode == self.episodes.running:
            for role in ROLES:
                self.guards.release(role)
        self.episodes.end(episode)

    def reset_safety(self) -> str:
        """Explicit reset of both arms, or of neither; returns why it was refused, empty when done."""
        missing = [role for role in ROLES if role not in self._readings]
        if missing:
            return f"no joint state of {', '.join(missing)} yet; start its driver"
        return self.guards.reset(self._readings)

    def _may_move(self, role: str) -> bool:
        return (
            not self.is_checking
            and not self._limits.observe_only
            and self.episodes.running >= 0
            and role not in self._silent_until_ns
            and role in self._readings
        )

    def _robot_s(self, role: str) -> float:
        return 1e-9 * self._readings[role].stamp_ns + self._limits.lead_s

    def _miss_arm(self, role: str, message: Any) -> None:
        """A joint state of a gripper or another arm on the same topic; where they go on alone, a fault."""
        missed_ns = from_message.stamp_ns(message) - self._passed_ns[role]
        if self._may_move(role) and missed_ns > _MISSED_NS and not self.guards.is_latched(role):
            self.guards.fault(
                role,
                f"no joint state of its own for {1e-9 * missed_ns:.1f} s, but of {list(message.name)}; "
                "start its driver, or correct `joints` in the driver's file",
            )
            self.guards.publish_safety()

    def _hear_arm(self, role: str, driver: DriverFile, message: Any, stamp_ns: int) -> None:
        if not adapter.is_due(self._passed_ns[role], stamp_ns):
            return
        spec, joints = self._cell.arm(role), driver.joints or {}
        converted = adapter.joint_state(message, joints, spec)
        heard = from_message.arm_reading(converted, spec.joint_names)
        reading = self._correction.reading(heard, spec.joint_names, role)
        converted.position = reading.position.tolist()
        if stamp_ns < self._silent_until_ns.get(role, stamp_ns):
            self._readings[role] = reading
            return
        self._passed_ns[role], self._readings[role] = stamp_ns, reading
        if self._silent_until_ns.pop(role, None) is not None and not self._silent_until_ns:
            header = to_message.header(stamp_ns)
            ready = EpisodeReady(header=header, episode=self.episodes.running, task=self._task.name)
            self._outbox.publish(READY, ready)
        self._outbox.publish(arm_topic(role, "joint_states"), converted)
        self._move(role, driver, reading)
        self.guards.publish_safety()
        if self._limits.publish_tf and stamp_ns - self._tf_ns >= _TF_PERIOD_NS and len(self._readings) == 2:
            self._tf_ns = stamp_ns
            positions = {r: self._readings[r].position for r in ROLES}
            self._outbox.publish(
                "/tf", TFMessage(transforms=dynamic_transforms(self._arms, positions, stamp_ns))
            )

    def _move(self, role: str, driver: DriverFile, reading: ArmReading) -> None:
        """Send a set point while commands are followed or the arm still brakes; else it holds by itself."""
        if self._limits.observe_only or driver.command is None:
            return
        point = self.guards.tick(role, reading, self._robot_s(role))
        if self.guards.is_in_charge(role, point):
            spec = self._cell.arm(role)
            sent = self._correction.command(point, spec.joint_names, role)
            self._send(role, adapter.controller_trajectory(sent, driver.joints or {}, spec.limits))
            self.sent += 1

    def _hear_camera(self, stream: str, message: Any) -> None:
        frame = self._camera.take(stream, message)
        if frame is None:
            return
        frame = self._correction.frame(frame, self._cell.intrinsics)
        messages = to_message.camera_frame(frame, self._cell.intrinsics, OPTICAL_FRAME)
        for name, image in messages.items():
            self._outbox.publish(camera_topic(name), image)
