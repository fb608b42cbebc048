"""`samrl bench actions`: the table of where an action's time goes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from samrl_core.studies.speed.time_per_action import NAME, PARTS, time_per_action
from samrl_ros.contract.exit_codes import OK


def bench_actions(run: Path) -> int:
    """Write the figures into the run's folder and print them; returns the exit code.

    Raises:
        InputError: the folder holds no run with times.
    """
    found = time_per_action(run)
    table = Table("wall time [s]", "mean", "median", "95 %", "max", "share", box=None)
    for part in PARTS:
        share = f"{100 * found['share_of_time'][part]:.0f} %"
        table.add_row(part, *_cells(found["parts_s"][part]), share)
    table.add_row("whole", *_cells(found["whole_s"]), "100 %")
    for name, key in (("with a new view", "with_a_new_view_s"), ("without", "without_s")):
        if found[key]["n"]:
            table.add_row(f"{name} ({found[key]['n']})", *_cells(found[key]), "")
    console = Console()
    console.print(table)
    for kind in ("json", "png"):
        console.print(run / f"{NAME}.{kind}", highlight=False, soft_wrap=True)
    return OK


def _cells(figures: dict[str, Any]) -> list[str]:
    return [f"{figures[key]:.2f}" for key in ("mean", "median", "q95", "max")]
