"""`samrl estop`: stop the arms of a running cell, or let them go on."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from samrl_core.common.errors import SamrlError
from samrl_ros.contract.exit_codes import FAILED, OK
from samrl_ros.contract.message_types import message_class
from samrl_ros.contract.topics import SERVICES, cell_topic
from samrl_ros.hosting.ros_check import require_ros

ESTOP, RESET = cell_topic("estop"), cell_topic("estop_reset")


@dataclass(frozen=True)
class EstopOptions:
    """Options of `samrl estop`."""

    reset: Annotated[bool, typer.Option("--reset", help="Reset the stop: the run goes on.")] = False
    timeout: Annotated[float, typer.Option(help="Longest wait for the cell's answer in s.", min=0.5)] = 20.0


def estop(options: EstopOptions) -> int:
    """Call the service and print its answer; exit code 1 when it refuses.

    Raises:
        SamrlError: no cell answers.
    """
    require_ros()
    from samrl_ros.hosting.host import on_graph

    with on_graph([]) as closers:
        answer = _call(RESET if options.reset else ESTOP, options.timeout, closers)
        refused = "" if answer.success else "[bold red]refused:[/] "
        Console().print(f"{refused}{escape(answer.message)}", highlight=False, soft_wrap=True)
    return OK if answer.success else FAILED


def _call(name: str, timeout_s: float, closers: list[Callable[[], object]]) -> Any:
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.node import Node

    kind = message_class(next(service.type for service in SERVICES if service.name == name))
    node, executor = Node("estop_caller"), EventsExecutor()
    executor.add_node(node)
    closers += [executor.shutdown, node.destroy_node, lambda: executor.remove_node(node)]
    client = node.create_client(kind, name)
    sent, deadline = None, time.monotonic() + timeout_s
    while sent is None or not sent.done():
        if time.monotonic() > deadline:
            missing = "is not there" if sent is None else "does not answer"
            raise SamrlError(
                f"service {name} {missing} after {timeout_s:g} s; start the cell or set its ROS_DOMAIN_ID"
            )
        if sent is None and client.service_is_ready():
            sent = client.call_async(kind.Request())
        executor.spin_once(timeout_sec=0.02)
    return sent.result()
