"""Watches a running cell from outside: progress, node states, and silence that should not be."""

from __future__ import annotations

import os
import sys
import time
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node

from samrl_core.cell.robots.robot import ROLES
from samrl_ros.cell.incidents import Incident
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.topics import NAMESPACE, TOPICS, arm_topic, cell_topic
from samrl_ros.conversions import from_message, to_message
from samrl_ros.nodes.registry import BRIDGES
from samrl_ros.nodes.standstill import ESTOP

BRIDGE_NAMES = frozenset(f"{NAMESPACE}/{name}" for name in BRIDGES)
PROGRESS_SILENCE_S = 180.0  # robot time without a new phase that means the cell is stuck
STEP_S = 1.0  # a longer step of robot time is a restart, not time that went by
JOINTS = arm_topic("tool_arm", "joint_states")
PHASE, OUTCOME, SAFETY = cell_topic("phase"), cell_topic("supervisor/outcome"), cell_topic("safety_state")
NOMINAL, NODE_WATCH = cell_topic("policy/nominal_action"), cell_topic("node_watch")


@dataclass
class NodeFigures:
    """Newest diagnostics of one node."""

    level: int
    text: str
    values: dict[str, str]
    seen: float  # monotonic [s]


class Marks:
    """When the phases of an episode began, in 16 bytes each: a run of hours has a million of them."""

    def __init__(self) -> None:
        self._seconds = array("d")
        self._names: list[str] = []

    def __iter__(self) -> Iterator[tuple[float, str]]:
        """Wall time since the episode was laid out [s] and a mark, in their order."""
        return zip(self._seconds, self._names, strict=True)

    def add(self, seconds: float, name: str) -> None:
        """One more; its name is kept once, however often it comes."""
        self._seconds.append(seconds)
        self._names.append(sys.intern(name))


@dataclass
class Watch:
    """What has been seen so far; plain data."""

    outcomes: dict[int, Any] = field(default_factory=dict)
    wall_time_s: dict[int, float] = field(default_factory=dict)
    marks: dict[int, Marks] = field(default_factory=dict)  # see `summary.summarise`
    phase: str = ""
    phases: int = 0
    safety: str = ""
    safety_level: int = 0
    estop: str = ""  # reason of the emergency stop in force
    estop_since: float = 0.0  # monotonic [s]
    incidents: list[Incident] = field(default_factory=list)
    begun: float = field(default_factory=time.monotonic)
    nodes: dict[str, NodeFigures] = field(default_factory=dict)
    last_joints: float = 0.0  # monotonic [s]
    reports: int = 0  # of the bridge on /diagnostics since then
    robot_s: float = 0.0  # robot time that went by, of the joint states' stamps
    progress_s: float = 0.0  # of it, at the newest phase
    episode_since: float = field(default_factory=time.monotonic)


def reset_command() -> str:
    """The command line that resets an emergency stop of this run, from another shell."""
    named = ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_BUILTIN_TRANSPORTS")
    given = [f"{name}={os.environ[name]}" for name in named if os.environ.get(name)]
    return " ".join([*given, "samrl estop --reset"])


class Monitor:
    """A node in the caller's thread; call `spin` often."""

    def __init__(
        self,
        on_event: Callable[[str], None] = lambda text: None,
        on_figures: Callable[[str, dict[str, str]], None] = lambda node, figures: None,
    ) -> None:
        """`on_event` hears what people should, `on_figures` every node's diagnostics by its full name."""
        self.watch = Watch()
        self._on_figures = on_figures
        self._marks = Marks()  # of the present episode
        self._on_event = on_event
        self._node = Node("monitor", namespace=NAMESPACE)
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        for name, callback in (
            (PHASE, self._on_phase),
            (OUTCOME, self._on_outcome),
            (NOMINAL, self._on_nominal),
            (SAFETY, self._on_safety),
            ("/diagnostics", self._on_diagnostics),
            (JOINTS, self._on_joints),
            *((arm_topic(role, "motion_status"), self._on_status) for role in ROLES),
        ):
            topic = TOPICS[name]
            self._node.create_subscription(message_class(topic.type), name, callback, qos_named(topic.qos))
        self._stamp_s = 0.0
        watch = TOPICS[NODE_WATCH]
        self._publisher = self._node.create_publisher(
            message_class(watch.type), NODE_WATCH, qos_named(watch.qos)
        )

    def tell(self, text: str) -> None:
        """Show a line where events are shown."""
        self._on_event(text)

    def spin(self, timeout_s: float = 0.05) -> None:
        """Take in what has come."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def is_taken(self) -> bool:
        """Whether somebody publishes joint states already: another cell, or a driver, in this ROS domain."""
        return self.watch.last_joints > 0.0 or self._node.count_publishers(JOINTS) > 0

    def is_active(self, node: str) -> bool:
        """Whether a node has reported itself active."""
        figures = self.watch.nodes.get(f"{NAMESPACE}/{node}")
        return figures is not None and figures.values.get("state") == "active"

    def has_joint_publisher(self) -> bool:
        """Whether somebody publishes joint states; a participant that is dead leaves the graph in seconds."""
        return self._node.count_publishers(JOINTS) > 0

    def publish_watch(self, node: str, level: int, text: str) -> None:
        """Tell the cell that a node is away (2: it starts anew, 1: it is held) or back (0)."""
        self._publisher.publish(to_message.diagnostic(node, level, text, {}))

    def forget(self, node: str) -> None:
        """What a node reported so far came from a process that is not there any more."""
        self.watch.nodes.pop(f"{NAMESPACE}/{node}", None)

    def excuse_progress(self) -> None:
        """Nobody expects a new phase now."""
        self.watch.progress_s = self.watch.robot_s

    def trouble(self, excused: frozenset[str] = frozenset()) -> str:
        """Why the run cannot go on, empty while it can; somebody else looks after excused nodes."""
        watch = self.watch
        for name, figures in watch.nodes.items():
            if figures.level >= 2 and name.rpartition("/")[2] not in excused:
                return f"{name}: {figures.text}"
        if watch.estop:
            self.excuse_progress()
        if watch.phases and watch.robot_s - watch.progress_s > PROGRESS_SILENCE_S:
            return f"no progress in {PROGRESS_SILENCE_S:.0f} s of robot time, in phase {watch.phase!r}"
        return ""

    def arms_stopped(self) -> str:
        """Why the arms stand in a fault or emergency stop that nobody has reset, empty when they do not."""
        return f"the arms are stopped: {self.watch.safety}" if self.watch.safety_level >= 2 else ""

    def close(self) -> None:
        """Leave the graph."""
        self._executor.remove_node(self._node)
        self._node.destroy_node()
        self._executor.shutdown()

    def _on_joints(self, message: Any) -> None:
        self.watch.last_joints, self.watch.reports = time.monotonic(), 0
        stamp_s = from_message.stamp_ns(message) * 1e-9
        step_s, self._stamp_s = stamp_s - self._stamp_s, stamp_s
        if 0.0 < step_s < STEP_S:
            self.watch.robot_s += step_s

    def _on_phase(self, message: Any) -> None:
        self.watch.phase = message.data
        self.watch.phases += 1
        self.excuse_progress()
        if message.data.startswith("episode "):
            self.watch.episode_since = time.monotonic()
            self._marks = self.watch.marks.setdefault(int(message.data.split()[1]), Marks())
        self._mark(message.data)

    def _on_nominal(self, message: Any) -> None:
        self._mark("move")

    def _mark(self, what: str) -> None:
        self._marks.add(time.monotonic() - self.watch.episode_since, what)

    def _on_outcome(self, message: Any) -> None:
        now = time.monotonic()
        self.watch.outcomes[int(message.episode)] = message
        self.watch.wall_time_s[int(message.episode)] = now - self.watch.episode_since
        self._on_event(f"episode {message.episode}: {message.reason}, {message.actions} actions")

    def note(self, what: str, text: str) -> None:
        """Keep and tell an incident."""
        watch = self.watch
        episode = max(watch.marks, default=-1)
        watch.incidents.append(Incident(time.monotonic() - watch.begun, episode, what, text))
        self._on_event(text)

    def _on_safety(self, message: Any) -> None:
        self._on_estop(message.message if any(v.value == ESTOP for v in message.values) else "")
        self.watch.safety_level = message.level[0]
        if message.message != self.watch.safety:
            self.watch.safety = message.message
            if message.level != b"\x00" and not self.watch.estop:
                self._on_event(f"safety: {message.message}")

    def _on_estop(self, reason: str) -> None:
        watch = self.watch
        if reason and not watch.estop:
            watch.estop_since = time.monotonic()
            self.note("estop", f"emergency stop: {reason}; the arms brake and hold, the run waits")
            self._on_event(f"  to go on:  {reset_command()}")
        elif watch.estop and not reason:
            waited = time.monotonic() - watch.estop_since
            self.note("reset", f"emergency stop reset after {waited:.0f} s; the run goes on")
        watch.estop = reason

    def _on_status(self, message: Any) -> None:
        if message.status == message.STOPPED:
            self.note("motion", f"{message.arm}: {message.message}")

    def _on_diagnostics(self, message: Any) -> None:
        now = time.monotonic()
        for status in message.status:
            values = {v.key: v.value for v in status.values}
            self.watch.nodes[status.name] = NodeFigures(status.level[0], status.message, values, now)
            self._on_figures(status.name, values)
            if status.name in BRIDGE_NAMES:
                self.watch.reports += 1
