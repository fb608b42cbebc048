"""The pre-flight before a run on a real cell: what the drivers say, before the first node is started."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.markup import escape

from samrl_core.cell.robots.cells import cell_named
from samrl_ros.cell.options import CellOptions, require_hardware
from samrl_ros.hardware.preflight import cell_faults, clock_offsets

SECONDS = 2.0  # that each topic is heard; `hardware_bridge` judges again before it lets anything move


def check_drivers(options: CellOptions, console: Console) -> bool:
    """Listen, judge and print; whether the run may begin.

    Raises:
        InputError: options that do not fit.
    """
    drivers = require_hardware(options)
    from samrl_ros.hardware.observe import observe
    from samrl_ros.hosting.host import on_graph

    with on_graph([sys.argv[0]]) as closers:
        heard = observe(drivers, SECONDS, closers, options.sim_time)
    faults = cell_faults(cell_named(options.cell), drivers, heard.arms, heard.images)
    for fault in faults:
        console.print(f"[bold red]no:[/] {escape(fault)}", highlight=False, soft_wrap=True)
    ages = ", ".join(
        f"{name} {1e3 * age:.1f} ms" for name, age in clock_offsets(heard.arms, heard.images).items()
    )
    console.print(f"age of stamps at reception, median: {ages or 'nothing heard'}", highlight=False)
    if faults and not options.observe:
        console.print(f"{len(faults)} faults; nothing is started", highlight=False)
        return False
    return True
