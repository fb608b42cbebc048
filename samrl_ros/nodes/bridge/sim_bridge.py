"""Hosts the simulated cell on the graph; drivers of a hardware cell take this node's place.

The world is stepped by a thread of its own, at most at `real_time_factor`; commands and services come
in on the node's thread. One lock is held for a controller period at a time.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, final

from samrl_core.cell.calibration.cell_correction import correction_of
from samrl_core.cell.instance.cell_instance import FILE, NOMINAL, instance_named, seal_instance
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.cell.world import DEFAULT_WORLD, WORLDS, make_world
from samrl_core.cell.world.evaluation import TruthLog
from samrl_core.common.errors import SamrlError
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.settings import REAL_TIME_FACTOR, setting
from samrl_ros.contract.topics import SERVICES, TOPICS, arm_topic, cell_topic
from samrl_ros.hosting import CellNode
from samrl_ros.nodes.bridge.arm_guards import COMMAND_TIMEOUT_S
from samrl_ros.nodes.bridge.bridge_core import BridgeCore, BridgeRates
from samrl_ros.nodes.bridge.commanders import Commanders, refuse_rivals
from samrl_ros.nodes.bridge.lockstep import Lockstep

HALT_S = 10.0  # within which a step of the world ends, an image of its camera included [s]
OUTCOME, WATCH = cell_topic("supervisor/outcome"), cell_topic("node_watch")


@dataclass(frozen=True)
class SimBridgeSettings:
    """Settings of `sim_bridge`."""

    task: str = setting(DEFAULT_TASK, "task whose scene is laid out")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    world: str = setting(DEFAULT_WORLD, "simulator behind the border", choices=WORLDS)
    instance: str = setting(
        NOMINAL, "true cell: nominal, LEVEL:SEED or LEVEL:test:SEED, then GROUP=FACTOR to scale a group"
    )
    correction: str = setting("", "cell.json of samrl diagnose --apply: what the cell is known to differ by")
    real_time_factor: float = setting(
        REAL_TIME_FACTOR, "upper bound of simulated over wall time, 0 for none", range=(0.0, 100.0)
    )
    joint_state_hz: int = setting(
        BridgeRates.joint_state_hz, "simulated rate of joint states and clock", "Hz", (10, 1000)
    )
    camera_hz: int = setting(BridgeRates.camera_hz, "simulated rate of images", "Hz", (1, 60))
    tf_hz: int = setting(BridgeRates.tf_hz, "simulated rate of tf", "Hz", (1, 250))
    command_timeout: float = setting(
        COMMAND_TIMEOUT_S, "age of a command, by reception, at which the arm brakes", "s", (0.01, 5.0)
    )
    patience: float = setting(
        5.0, "simulated time stands still so long for late commands, by the wall clock", "s", (0.0, 60.0)
    )
    evaluation_file: str = setting("", "where evaluation truth is written, empty for nowhere")


@final
class SimBridge(CellNode):
    """Publishes as drivers would, and keeps the command guard next to the arms."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("sim_bridge", SimBridgeSettings, **node_options)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._core: BridgeCore | None = None
        self._world: Any = None
        self._publishers_by_topic: dict[str, Any] = {}
        self._handles: list[Any] = []
        self._commanders: dict[str, Commanders] = {}
        self._commander_away = False
        self._published = 0
        self._rate = 0.0
        self._longest_gap_s = 0.0

    def publish(self, topic: str, message: Any) -> None:
        """The core's outbox."""
        self._publishers_by_topic[topic].publish(message)
        self._published += 1

    def call(self, service: str, request: Any, on_response: Any) -> None:
        """The core's outbox: a bridge calls no service."""
        raise SamrlError(f"sim_bridge asked for {service}; it serves, it does not call")

    def set_up(self, settings: SimBridgeSettings) -> None:
        """See `CellNode`."""
        self._refuse_while_stepping()
        task, cell = task_named(settings.task), cell_named(settings.cell)
        instance = instance_named(settings.instance, cell)
        self._world = make_world(settings.world, task, cell, instance=instance)
        log = None
        if settings.evaluation_file:
            file = Path(settings.evaluation_file)
            log = TruthLog(file, self._world)
            seal_instance(file.with_name(FILE), instance)
        for topic in TOPICS.values():
            if topic.publisher == "sim_bridge":
                self._publishers_by_topic[topic.name] = self.create_publisher(
                    message_class(topic.type), topic.name, qos_named(topic.qos)
                )
        self._core = BridgeCore(
            self,
            self._world,
            cell,
            task,
            BridgeRates(settings.joint_state_hz, settings.camera_hz, settings.tf_hz),
            settings.command_timeout,
            log,
            time.monotonic,
            correction_of(settings.correction),
        )
        self._factor, self._patience_s = settings.real_time_factor, settings.patience
        for role in ROLES:
            subscription = self._subscribe(arm_topic(role, "command"), partial(self._on_command, role))
            self._commanders[role] = Commanders(self, subscription)
        self._subscribe(OUTCOME, self._on_outcome)
        self._subscribe(WATCH, self._on_watch)
        handlers = {
            cell_topic("sim_bridge/start_episode"): self._on_start,
            cell_topic("estop"): self._on_estop,
            cell_topic("estop_reset"): self._on_reset,
        }
        for service in SERVICES:
            if service.name in handlers:
                self._handles.append(
                    self.create_service(message_class(service.type), service.name, handlers[service.name])
                )

    def begin(self) -> None:
        """See `CellNode`."""
        assert self._core is not None
        with self._lock:
            self._core.announce()
        self._stop.clear()
        self._thread = threading.Thread(
            target=lambda: self.guard("stepping the world", self._run), name="sim_bridge world", daemon=True
        )
        self._thread.start()

    def halt(self) -> None:
        """See `CellNode`.

        Raises:
            SamrlError: the world is still being stepped after `HALT_S`.
        """
        self._stop.set()
        if self._thread is not None:
            self._thread.join(HALT_S)
            self._refuse_while_stepping()
            self._thread = None

    def tear_down(self) -> None:
        """See `CellNode`.

        Raises:
            SamrlError: the world is still being stepped; nothing is destroyed under it.
        """
        self._refuse_while_stepping()
        for handle in self._handles:
            destroy = self.destroy_service if hasattr(handle, "srv_type") else self.destroy_subscription
            destroy(handle)
        for publisher in self._publishers_by_topic.values():
            self.destroy_publisher(publisher)
        if self._world is not None:
            self._world.close()
        self._handles, self._publishers_by_topic, self._world, self._core = [], {}, None, None

    def _refuse_while_stepping(self) -> None:
        if self._thread is not None and self._thread.is_alive():
            raise SamrlError(
                f"the simulated world is still being stepped {HALT_S:g} s after it was stopped; "
                "end this process and start another one"
            )

    def figures(self) -> dict[str, str]:
        """See `CellNode`."""
        core = self._core
        return {
            "real_time_factor": f"{self._rate:.3f}",
            "longest_gap_s": f"{self._longest_wall_gap():.4f}",
            "sim_time_s": f"{core.time_ns * 1e-9:.3f}" if core else "0",
            "published": str(self._published),
            "command_lead_min_ms": f"{self._least_lead_ms():.1f}",
            "refused_commands": str(core.guards.refused_commands) if core else "0",
        }

    def _longest_wall_gap(self) -> float:
        """Longest standstill of the simulation since the last report, wall time [s]."""
        gap, self._longest_gap_s = self._longest_gap_s, 0.0
        return gap

    def _least_lead_ms(self) -> float:
        """Worst lead of commands since the last report; negative means that they came too late."""
        if self._core is None:
            return float("nan")
        guards = self._core.guards
        lead, guards.least_lead_ms = guards.least_lead_ms, float("inf")
        return lead

    def _subscribe(self, name: str, callback: Any) -> Any:
        topic = TOPICS[name]
        self._handles.append(
            self.create_subscription(message_class(topic.type), name, callback, qos_named(topic.qos))
        )
        return self._handles[-1]

    def _run(self) -> None:
        """Step until halted, keeping pace with the wall clock but never catching up in a burst."""
        core = self._core
        assert core is not None
        period = 0.004  # controller periods go in packs of one joint-state period: fewer wake-ups
        due = window_wall = time.monotonic()
        window_sim = core.time_ns
        last = due
        lockstep = Lockstep(self._patience_s)
        while not self._stop.is_set():
            # In lockstep: a simulation that outran the manipulator would make every command late.
            while self._waits(core, lockstep, 2 * period) and not self._stop.is_set():
                self._stop.wait(0.0005)
            end_ns = core.time_ns + round(period * 1e9)
            while core.time_ns < end_ns and not self._stop.is_set():
                with self._lock:
                    core.tick()
            now = time.monotonic()
            self._longest_gap_s = max(self._longest_gap_s, now - last)
            if now - window_wall > 1.0:
                self._rate = (core.time_ns - window_sim) * 1e-9 / (now - window_wall)
                window_wall, window_sim = now, core.time_ns
            if self._factor > 0:
                due = max(due + period / self._factor, now - period)
                self._stop.wait(max(0.0, due - now))
            else:
                time.sleep(0)  # let the other threads of this process run
            last = time.monotonic()

    def _waits(self, core: BridgeCore, lockstep: Lockstep, within_s: float) -> bool:
        with self._lock:
            short, taken = core.waits_for_commands(within_s), core.guards.taken
        if short and (self._commander_away or not any(c.is_there() for c in self._commanders.values())):
            short = False
        return lockstep.waits(short, taken, time.monotonic())

    def _on_watch(self, message: Any) -> None:
        if message.name == "manipulator":
            self._commander_away = message.level >= b"\x02"

    def _on_command(self, role: str, message: Any) -> None:
        publishers = self._commanders[role].find_publishers()
        with self._lock:
            if self._core is None or not publishers:
                return
            if len(publishers) > 1:
                self._core.guards.on_rivals(role, list(publishers.values()))
            else:
                self._core.on_command(role, message, next(iter(publishers)))

    def _on_outcome(self, message: Any) -> None:
        with self._lock:
            if self._core is not None:
                self._core.end_episode(message.episode)

    def _on_start(self, request: Any, response: Any) -> Any:
        if self._core is None or self._thread is None:
            response.success, response.message = False, f"sim_bridge is {self.stage}; activate it first"
            return response
        with self._lock:
            try:
                refuse_rivals(self._commanders)
                self._core.start_episode(int(request.episode), int(request.seed))
            except SamrlError as error:
                response.success, response.message = False, str(error)
                return response
        response.success, response.message = True, ""
        return response

    def _on_estop(self, request: Any, response: Any) -> Any:
        with self._lock:
            if self._core is not None:
                self._core.guards.estop("asked for by service")
        response.success, response.message = self._core is not None, "arms brake and hold until estop_reset"
        return response

    def _on_reset(self, request: Any, response: Any) -> Any:
        with self._lock:
            refusal = self._core.reset_safety() if self._core is not None else "sim_bridge is not active"
        response.success, response.message = not refusal, refusal or "ready for commands"
        return response
