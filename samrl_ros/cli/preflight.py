"""`samrl preflight`: whether the drivers of a real cell speak as the cell expects. Nothing moves."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import InputError
from samrl_ros.contract.exit_codes import FAILED, OK
from samrl_ros.hardware.driver_file import driver_named
from samrl_ros.hardware.preflight import cell_faults
from samrl_ros.hosting.ros_check import require_ros

KINDS = {"tool_arm": "arm", "camera_arm": "arm", "camera": "camera"}


@dataclass(frozen=True)
class PreflightOptions:
    """Options of `samrl preflight`; an empty driver is not checked."""

    tool_arm: Annotated[str, typer.Option(help="Driver by name or YAML file.")] = "franka_ros2"
    camera_arm: Annotated[str, typer.Option(help="Driver by name or YAML file.")] = "flexiv_ros2"
    camera: Annotated[str, typer.Option(help="Driver by name or YAML file.")] = "realsense_ros"
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = DEFAULT_CELL
    seconds: Annotated[float, typer.Option(help="To listen.", min=0.5, max=60.0)] = 3.0


def preflight(options: PreflightOptions) -> int:
    """Listen, check, and print what speaks against moving; exit code 1 then.

    Raises:
        InputError: no such driver or cell, or a driver of the other kind.
    """
    cell = cell_named(options.cell)
    drivers = {part: driver_named(name) for part in KINDS if (name := getattr(options, part))}
    if not drivers:
        raise InputError("no driver is named; give --tool-arm, --camera-arm or --camera")
    for part, driver in drivers.items():
        if driver.kind != KINDS[part]:
            raise InputError(
                f"{driver.package} drives a {driver.kind}; --{part.replace('_', '-')} needs another"
            )
    require_ros()
    from samrl_ros.hardware.observe import observe
    from samrl_ros.hosting.host import start_ros, stop_ros

    start_ros([])
    try:
        heard = observe(drivers, options.seconds, time.time)
    finally:
        stop_ros()
    faults = cell_faults(cell, drivers, heard.arms, heard.images)
    console = Console()
    for fault in faults:
        console.print(f"[bold red]no:[/] {escape(fault)}", highlight=False, soft_wrap=True)
    if faults:
        console.print(f"{len(faults)} faults; do not move the arms", highlight=False)
        return FAILED
    console.print("names, limits, clocks, frames and rates agree", highlight=False)
    return OK
