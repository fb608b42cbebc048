"""`samrl experiment`: one table or figure, with progress on the terminal."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from samrl_core.common.errors import InputError
from samrl_core.studies.experiment import Options
from samrl_core.studies.registry import MODULES, experiment_named


@dataclass(frozen=True)
class ExperimentOptions:
    """Options of `samrl experiment`; see `Options` for what an experiment makes of them."""

    name: Annotated[str | None, typer.Argument(help="Which; without it, a list.")] = None
    out: Annotated[
        Path | None, typer.Option(help="Folder of this experiment; out/NAME by default. Goes on from it.")
    ] = None
    tasks: Annotated[tuple[str, ...], typer.Option("--task", help="Only this task; may be repeated.")] = ()
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = Options.cell
    count: Annotated[
        int, typer.Option(help="Episodes or states per condition, or real steps; 0: the experiment's.", min=0)
    ] = Options.count
    seed: Annotated[int, typer.Option(help="Of the first episode or state.", min=0)] = Options.seed
    device: Annotated[str, typer.Option(help="Of batched rendering: cpu, or cuda:0.")] = Options.device
    workers: Annotated[int, typer.Option(help="Processes; 0: free cores.", min=0)] = Options.workers
    weights: Annotated[
        Path | None, typer.Option(help="Folder of trained networks, in place of the package's.")
    ] = None
    conditions: Annotated[
        tuple[str, ...],
        typer.Option("--condition", help="Only this condition of those compared; may be repeated."),
    ] = ()
    ray: Annotated[
        bool, typer.Option("--ray", help="Cases on a Ray cluster that sees the same folder (extra cluster).")
    ] = Options.ray


def _list_experiments() -> int:
    table = Table(box=None)
    for title in ("experiment", "shows", "tasks"):
        table.add_column(title)
    for name in sorted(MODULES):
        found = experiment_named(name)
        more = f"; if asked for, {', '.join(found.on_request)}" if found.on_request else ""
        table.add_row(name, found.shows, ", ".join(found.tasks) + more)
    Console().print(table)
    return 0


def run_experiment(options: ExperimentOptions) -> int:
    """Run what is left of an experiment, or list them. After an interrupt the same command goes on.

    Raises:
        InputError: there is none of this name, or its options do not fit, or its folder cannot be written.
        KeyboardInterrupt: interrupted.
    """
    if options.name is None:
        return _list_experiments()
    given: dict[str, Any] = {field.name: getattr(options, field.name) for field in fields(Options)}
    given["out"] = out = options.out or Path("out") / options.name
    asked, console = Options(**given), Console()
    experiment = experiment_named(options.name)
    try:
        experiment.result(asked, lambda line: console.print(line, highlight=False, soft_wrap=True))
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on from {out}", highlight=False)
        raise
    except OSError as error:
        raise InputError(f"cannot write to {out} ({error}); give another --out") from error
    # A picture of its own for each task, where it makes them so.
    for path in (out / f"{options.name}.json", *sorted(out.glob(f"{options.name}*.png"))):
        console.print(path, highlight=False, soft_wrap=True)
    return 0
