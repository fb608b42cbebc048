"""The whole cell in one thread, without DDS: every message is handled in the order of publication.

For tests and for debugging a behaviour; the same objects run on the live graph. Repeatable to the bit.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from samrl_core.cell.instance.cell_instance import NOMINAL, instance_named
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world import DEFAULT_WORLD, make_world
from samrl_core.cell.world.evaluation import TruthLog
from samrl_core.common.errors import SamrlError
from samrl_ros.contract.behaviour import Behaviour
from samrl_ros.contract.topics import LATCHED, STATIC_TF, TOPICS, arm_topic, cell_topic
from samrl_ros.nodes.bridge.arm_guards import COMMAND_TIMEOUT_S
from samrl_ros.nodes.bridge.bridge_core import BridgeCore, BridgeRates
from samrl_ros.nodes.registry import behaviour_nodes
from samrl_ros.nodes.supervisor import START_EPISODE, Supervisor


@dataclass
class LocalOutbox:
    """Output of one node: its messages go to the graph's queue."""

    graph: LocalGraph
    node: str

    def publish(self, topic: str, message: Any) -> None:
        """See `Outbox`."""
        self.graph.queue.append((topic, message))

    def log(self, level: str, text: str) -> None:
        """See `Outbox`."""
        self.graph.logs.append((self.node, level, text))

    def call(self, service: str, request: Any, on_response: Callable[[Any], None]) -> None:
        """See `Outbox`."""
        self.graph.calls.append((service, request, on_response))


@dataclass
class LocalGraph:
    """Bridge and behaviours of one task; `run` goes on until the supervisor has finished."""

    task: str
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)  # overrides per node
    truth_file: Path | None = None
    world_kind: str = DEFAULT_WORLD
    cell: str = DEFAULT_CELL
    instance: str = NOMINAL  # of the world
    listener: Callable[[str, Any], None] = lambda topic, message: None
    queue: deque[tuple[str, Any]] = field(default_factory=deque)
    calls: deque[tuple[str, Any, Callable[[Any], None]]] = field(default_factory=deque)
    logs: list[tuple[str, str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        task, cell = task_named(self.task), cell_named(self.cell)
        self.world = make_world(self.world_kind, task, cell, instance=instance_named(self.instance, cell))
        log = TruthLog(self.truth_file, self.world) if self.truth_file else None
        self.bridge = BridgeCore(
            LocalOutbox(self, "sim_bridge"),
            self.world,
            cell,
            task,
            BridgeRates(),
            command_timeout_s=COMMAND_TIMEOUT_S,
            truth_log=log,
            steady_s=lambda: self.world.time_ns * 1e-9,
        )
        self.nodes: dict[str, Behaviour] = {}
        for name, entry in behaviour_nodes().items():
            settings = entry.settings(**{"task": self.task, "cell": self.cell, **self.settings.get(name, {})})
            self.nodes[name] = entry.behaviour(settings, LocalOutbox(self, name))
        self._hears: dict[str, list[Behaviour]] = defaultdict(list)
        for node in self.nodes.values():
            for topic in node.inputs:
                self._hears[topic].append(node)
        self.latched: dict[str, Any] = {}

    def run(self, max_sim_s: float = 600.0) -> None:
        """Until the supervisor has finished or simulated time runs out."""
        self.bridge.announce()
        self.drain()
        for node in self.nodes.values():
            node.start()
        supervisor = self.nodes["supervisor"]
        assert isinstance(supervisor, Supervisor)
        while not supervisor.finished and self.bridge.time_ns < max_sim_s * 1e9:
            self._serve()
            self.bridge.tick()
            self.drain()

    def close(self) -> None:
        """Stop the behaviours and release the world."""
        for node in self.nodes.values():
            node.stop()
        self.world.close()

    def _serve(self) -> None:
        while self.calls:
            service, request, on_response = self.calls.popleft()
            assert service == START_EPISODE
            refusal = ""
            try:
                self.bridge.start_episode(request.episode, request.seed)
            except SamrlError as error:  # as `sim_bridge` answers
                refusal = str(error)
            on_response(type("Response", (), {"success": not refusal, "message": refusal})())
            self.drain()

    def drain(self) -> None:
        """Deliver all queued messages, and those published in answer."""
        commands = {arm_topic(role, "command"): role for role in ROLES}
        while self.queue:
            topic, message = self.queue.popleft()
            if TOPICS[topic].qos in (LATCHED, STATIC_TF):
                self.latched[topic] = message
            self.listener(topic, message)
            if topic in commands:
                self.bridge.on_command(commands[topic], message)
            elif topic == cell_topic("supervisor/outcome"):
                self.bridge.end_episode(message.episode)
            for node in self._hears[topic]:
                node.handle(topic, message)
