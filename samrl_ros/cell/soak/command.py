"""`samrl bench soak`: turns, report, exit code."""

from __future__ import annotations

from rich.console import Console

from samrl_ros.cell.soak.options import SoakOptions
from samrl_ros.cell.soak.report import print_soak, report_soak
from samrl_ros.cell.soak.soak import run_soak
from samrl_ros.contract.exit_codes import FAILED, INTERRUPTED, OK
from samrl_ros.hosting.ros_check import require_ros


def soak_cell(options: SoakOptions) -> int:
    """Soak and report; an interrupted soak reports what it has. Returns the exit code.

    Raises:
        InputError: as `run_soak`.
    """
    require_ros()
    from samrl_ros.hosting.host import stop_signals

    console = Console()
    with stop_signals() as stop:
        turns = run_soak(options, stop, lambda text: console.print(text, highlight=False, soft_wrap=True))
        if not turns:
            console.print("interrupted before the first turn's end; nothing to report")
            return INTERRUPTED
        found = report_soak(turns, options.out)
    print_soak(found, console)
    for kind in ("json", "png"):
        console.print(options.out / f"soak.{kind}", highlight=False, soft_wrap=True)
    return INTERRUPTED if stop.is_set() else FAILED if found["errors"] else OK
