"""`samrl preflight`: whether the drivers of a real cell speak as the cell expects. Nothing moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.common.errors import InputError
from samrl_ros.contract.exit_codes import FAILED, OK
from samrl_ros.hardware.driver_file import PARTS, drivers_by_part
from samrl_ros.hardware.preflight import MAX_OFFSET_S, cell_faults, clock_offsets
from samrl_ros.hosting.ros_check import require_ros


@dataclass(frozen=True)
class PreflightOptions:
    """Options of `samrl preflight`; an empty driver is not checked."""

    tool_arm: Annotated[str, typer.Option(help="Driver by name or YAML file.")] = "franka_ros2"
    camera_arm: Annotated[str, typer.Option(help="Driver by name or YAML file.")] = "flexiv_ros2"
    camera: Annotated[str, typer.Option(help="Driver by name or YAML file.")] = "realsense_ros"
    segmenter: Annotated[str, typer.Option(help="Driver by name or YAML file; none by default.")] = ""
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = DEFAULT_CELL
    seconds: Annotated[float, typer.Option(help="To hear each topic.", min=0.5, max=60.0)] = 3.0
    sim_time: Annotated[bool, typer.Option("--sim-time", help="Stamps are of a simulator's /clock.")] = False


def preflight(options: PreflightOptions) -> int:
    """Listen, check, and print what speaks against moving; exit code 1 then.

    Raises:
        InputError: no such driver or cell, or a driver of the other kind.
    """
    cell = cell_named(options.cell)
    drivers = drivers_by_part([f"{part}={name}" for part in PARTS if (name := getattr(options, part))])
    if not drivers:
        raise InputError("no driver is named; give --tool-arm, --camera-arm, --camera or --segmenter")
    require_ros()
    from samrl_ros.hardware.observe import observe
    from samrl_ros.hosting.host import on_graph

    with on_graph([]) as closers:
        heard = observe(drivers, options.seconds, closers, options.sim_time)
        faults = cell_faults(cell, drivers, heard.arms, heard.images)
        _print_findings(faults, clock_offsets(heard.arms, heard.images))
    return FAILED if faults else OK


def _print_findings(faults: Sequence[str], ages_s: Mapping[str, float]) -> None:
    console = Console()
    for fault in faults:
        console.print(f"[bold red]no:[/] {escape(fault)}", highlight=False, soft_wrap=True)
    for name, age in ages_s.items():
        console.print(
            f"{name}: stamps are {1e3 * age:.1f} ms old at reception, limit of arms {1e3 * MAX_OFFSET_S:.0f}",
            highlight=False,
        )
    if faults:
        console.print(f"{len(faults)} faults; do not move the arms", highlight=False)
    else:
        console.print("names, limits, clocks, frames and rates agree", highlight=False)
