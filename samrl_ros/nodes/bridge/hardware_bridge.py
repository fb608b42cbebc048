"""Hosts the border to the drivers of a real cell, in the place of `sim_bridge`.

Everything runs on the node's thread. Driver messages come in at their own rates; commands go out to the arms'
controllers only after the pre-flight, within an episode that an operator has begun.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, final

from rclpy.qos import QoSProfile

from samrl_core.cell.calibration.calibrate import calibrated_cell
from samrl_core.cell.calibration.cell_correction import correction_of
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.common.errors import InputError, SamrlError
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.qos import qos_named
from samrl_ros.contract.settings import JUDGES, setting
from samrl_ros.contract.topics import SERVICES, TOPICS, arm_topic, cell_topic
from samrl_ros.hardware.driver_file import PARTS, drivers_by_part
from samrl_ros.hardware.observe import PATIENCE, subscribe
from samrl_ros.hosting import CellNode
from samrl_ros.nodes.bridge.arm_guards import COMMAND_TIMEOUT_S
from samrl_ros.nodes.bridge.commanders import Commanders, refuse_rivals
from samrl_ros.nodes.bridge.hardware_core import HardwareCore, HardwareLimits

NAME = "hardware_bridge"
OUTCOME = cell_topic("supervisor/outcome")
NOT_SPOKEN = (
    "/clock",
    *(arm_topic(role, name) for role in ROLES for name in ("commanded_effort", "controller")),
)


@dataclass(frozen=True)
class HardwareBridgeSettings:
    """Settings of `hardware_bridge`."""

    task: str = setting(DEFAULT_TASK, "task whose scene is laid out by the operator")
    cell: str = setting(DEFAULT_CELL, "cell whose arms and camera these are")
    drivers: tuple[str, ...] = setting(
        ("",), "DRIVER or PART=DRIVER: names of drivers that ship with the package, or YAML files"
    )
    observe_only: bool = setting(False, "hear and record drivers; nothing is ever sent to one")
    judge: str = setting(JUDGES[0], "who says whether an episode succeeded", choices=JUDGES)
    hand_eye: str = setting("", "calibration.json of the camera in its flange, empty for the cell's nominal")
    correction: str = setting("", "cell.json of samrl diagnose --apply: what the cell is known to differ by")
    bases: str = setting("", "calibration.json of the tool arm's base in the camera arm's, empty for nominal")
    preflight_time: float = setting(
        3.0, "that each topic of a driver is heard before it is judged", "s", (0.5, 60.0)
    )
    preflight_windows: int = setting(
        5,
        "times that the drivers are watched for so long before they count as wrong: a start is busy",
        range=(1, 100),
    )
    command_timeout: float = setting(
        COMMAND_TIMEOUT_S, "age of a command, by reception, at which the arm brakes", "s", (0.01, 5.0)
    )
    lead: float = setting(
        0.012,
        "how far ahead of a joint state its set point is sent; below manipulator's horizon",
        "s",
        (0.002, 0.05),
    )
    publish_tf: bool = setting(True, "false where the drivers' robot_state_publisher has the frames")


@final
class HardwareBridge(CellNode):
    """Publishes the cell's topics from the drivers', and keeps the command guard before the arms."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__(NAME, HardwareBridgeSettings, **node_options)
        self._core: HardwareCore | None = None
        self._publishers_by_topic: dict[str, Any] = {}
        self._controllers: dict[str, Any] = {}
        self._subscriptions_made: list[Any] = []
        self._services_made: list[Any] = []
        self._commanders: dict[str, Commanders] = {}
        self._settings = HardwareBridgeSettings()
        self._deadline = 0.0  # monotonic [s], of the pre-flight
        self._windows = 0  # of it that have failed

    def publish(self, topic: str, message: Any) -> None:
        """The core's outbox."""
        self._publishers_by_topic[topic].publish(message)

    def call(self, service: str, request: Any, on_response: Any) -> None:
        """The core's outbox: a bridge calls no service."""
        raise SamrlError(f"{NAME} asked for {service}; it serves, it does not call")

    def set_up(self, settings: HardwareBridgeSettings) -> None:
        """See `CellNode`."""
        self._settings = settings
        drivers = drivers_by_part([name for name in settings.drivers if name])
        missing = [part for part in PARTS if part not in drivers]
        if missing and not settings.observe_only:
            raise InputError(
                f"no driver of {', '.join(missing)} is named; the cell needs all, or observe_only"
            )
        if not drivers:
            raise InputError("no driver is named; set the parameter drivers")
        for part, driver in drivers.items():
            if driver.kind == "arm" and driver.command is None and not settings.observe_only:
                raise InputError(
                    f"driver {driver.package} of {part} names no command topic; add it, or observe_only"
                )
        cell = calibrated_cell(
            cell_named(settings.cell), *(Path(f) if f else None for f in (settings.hand_eye, settings.bases))
        )
        for topic in TOPICS.values():
            if topic.publisher in ("sim_bridge", NAME) and topic.name not in NOT_SPOKEN:
                self._publishers_by_topic[topic.name] = self.create_publisher(
                    message_class(topic.type), topic.name, qos_named(topic.qos)
                )
        limits = HardwareLimits(
            settings.command_timeout,
            settings.lead,
            settings.observe_only,
            settings.judge == "operator",
            settings.publish_tf,
        )
        self._core = HardwareCore(
            self,
            cell,
            task_named(settings.task),
            drivers,
            limits,
            time.monotonic,
            self._send,
            correction_of(settings.correction),
        )
        if not settings.observe_only:
            for role in ROLES:
                command = drivers[role].command
                assert command is not None
                self._controllers[role] = self.create_publisher(
                    message_class(command.type), command.driver_topic, QoSProfile(depth=10)
                )
        self._subscriptions_made = subscribe(self, drivers, self._on_driver)
        for role in ROLES:
            subscription = self._subscribe(arm_topic(role, "command"), partial(self._on_command, role))
            self._commanders[role] = Commanders(self, subscription)
        self._subscribe(OUTCOME, self._on_outcome)
        self._serve()

    def begin(self) -> None:
        """See `CellNode`."""
        assert self._core is not None
        self._core.announce()
        self._windows = 0
        self._deadline = time.monotonic() + PATIENCE * self._settings.preflight_time

    def halt(self) -> None:
        """See `CellNode`: a controller that hears no more set points brakes and holds by itself."""

    def tear_down(self) -> None:
        """See `CellNode`."""
        for subscription in self._subscriptions_made:
            self.destroy_subscription(subscription)
        for service in self._services_made:
            self.destroy_service(service)
        for publisher in [*self._publishers_by_topic.values(), *self._controllers.values()]:
            self.destroy_publisher(publisher)
        self._subscriptions_made, self._services_made = [], []
        self._publishers_by_topic, self._controllers, self._core = {}, {}, None

    def figures(self) -> dict[str, str]:
        """See `CellNode`."""
        core = self._core
        if core is None:
            return {"preflight": "not begun"}
        lead, core.guards.least_lead_ms = core.guards.least_lead_ms, float("inf")
        return {
            "preflight": "under way" if core.is_checking else "passed",
            "running_episode": str(core.episodes.running),
            "refused_messages": str(core.refused),
            "refused_commands": str(core.guards.refused_commands),
            "set_points_sent": str(core.sent),
            "command_lead_min_ms": f"{lead:.1f}",
            **{f"stamp_age_ms_{name}": f"{1e3 * age:.1f}" for name, age in core.offsets.items()},
        }

    def settle(self) -> None:
        """See `CellNode`; called at least every 50 ms, so it also ends the pre-flight."""
        core = self._core
        if core is not None and core.is_checking and self.stage == "active" and not self.failure:
            late = time.monotonic() > self._deadline
            if late or core.has_heard_enough(self._settings.preflight_time):
                self.guard("pre-flight", self._judge_drivers)
        super().settle()

    def _judge_drivers(self) -> None:
        assert self._core is not None
        faults = self._core.finish_preflight()
        for fault in faults:
            self.get_logger().warning(f"pre-flight: {fault}")
        if faults and not self._settings.observe_only:
            self._windows += 1
            late = time.monotonic() > self._deadline
            if not late and self._windows < self._settings.preflight_windows:
                self._core.watch_anew()
                self._deadline = time.monotonic() + PATIENCE * self._settings.preflight_time
                return
            raise InputError("the drivers do not agree with the cell, nothing moves: " + "; ".join(faults))
        self.get_logger().info(
            "pre-flight: names, limits, clocks, frames and rates agree" if not faults else "observing"
        )

    def _send(self, role: str, message: Any) -> None:
        self._controllers[role].publish(message)

    def _subscribe(self, name: str, callback: Any) -> Any:
        topic = TOPICS[name]
        self._subscriptions_made.append(
            self.create_subscription(message_class(topic.type), name, callback, qos_named(topic.qos))
        )
        return self._subscriptions_made[-1]

    def _serve(self) -> None:
        handlers = {
            cell_topic("sim_bridge/start_episode"): self._on_start,
            cell_topic("operator/scene_ready"): self._on_scene_ready,
            cell_topic("operator/judge"): self._on_judge,
            cell_topic("estop"): self._on_estop,
            cell_topic("estop_reset"): self._on_reset,
        }
        for service in SERVICES:
            if service.name in handlers:
                self._services_made.append(
                    self.create_service(message_class(service.type), service.name, handlers[service.name])
                )

    def _on_driver(self, part: str, stream: str, message: Any) -> None:
        if self._core is not None and self.stage == "active" and not self.failure:
            now_s = 1e-9 * self.get_clock().now().nanoseconds
            self.guard(f"hearing {part}", self._core.hear, part, stream, message, now_s)

    def _on_command(self, role: str, message: Any) -> None:
        publishers = self._commanders[role].find_publishers()
        if self._core is None or self.stage != "active" or not publishers:
            return
        if len(publishers) > 1:
            self._core.on_rivals(role, list(publishers.values()))
        else:
            self._core.on_command(role, message, next(iter(publishers)))

    def _on_outcome(self, message: Any) -> None:
        if self._core is not None:
            self._core.end_episode(message.episode)

    def _on_start(self, request: Any, response: Any) -> Any:
        def start(core: HardwareCore) -> None:
            refuse_rivals(self._commanders)
            core.start_episode(int(request.episode))

        return self._answer(response, start)

    def _on_scene_ready(self, request: Any, response: Any) -> Any:
        def begin(core: HardwareCore) -> None:
            refuse_rivals(self._commanders)
            core.begin_episode()

        return self._answer(response, begin, "the episode begins; stand back")

    def _on_judge(self, request: Any, response: Any) -> Any:
        def record(core: HardwareCore) -> None:
            refusal = core.episodes.record_judgement(bool(request.data))
            if refusal:
                raise InputError(refusal)

        return self._answer(response, record, "noted")

    def _on_estop(self, request: Any, response: Any) -> Any:
        text = "arms brake and hold until estop_reset"
        return self._answer(response, lambda core: core.guards.estop("asked for by service"), text)

    def _on_reset(self, request: Any, response: Any) -> Any:
        def reset(core: HardwareCore) -> None:
            refusal = core.reset_safety()
            if refusal:
                raise InputError(refusal)

        return self._answer(response, reset, "ready for commands")

    def _answer(self, response: Any, action: Any, text: str = "") -> Any:
        response.success, response.message = True, text
        try:
            if self._core is None or self.stage != "active" or self.failure:
                raise InputError(f"{NAME} is {self.failure or self.stage}; activate it first")
            action(self._core)
        except SamrlError as error:
            response.success, response.message = False, str(error)
        return response
