"""`samrl bench`: one command per benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

bench_app = typer.Typer(help="Measure.", no_args_is_help=True)


@bench_app.callback()
def benchmarks() -> None:
    """Measure; results are JSON and a table."""


@bench_app.command("cell")
def cell(
    out: Annotated[Path, typer.Option(help="Folder for the run and bench.json; must not be in use.")] = Path(
        "out/bench"
    ),
    seed: Annotated[int, typer.Option(help="Seed of the first episode.", min=0)] = 0,
    episodes: Annotated[int, typer.Option(help="Episodes to run.", min=1)] = 2,
    real_time_factor: Annotated[float, typer.Option(help="Upper bound, 0 for none.", min=0.0)] = 1.0,
) -> None:
    """Run the cell, every node in its own process: CPU share per node, ages, loop time per action."""
    from samrl_ros.bench.cell_bench import bench_cell

    raise typer.Exit(bench_cell(out, seed, episodes, real_time_factor))
