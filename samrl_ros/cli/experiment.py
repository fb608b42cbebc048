"""`samrl experiment`: one table or figure, with progress on the terminal."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from samrl_core.common.errors import InputError
from samrl_core.studies.experiment import Options
from samrl_core.studies.registry import MODULES, experiment_named


def list_experiments() -> int:
    """Print what there is."""
    table = Table(box=None)
    for title in ("experiment", "shows", "tasks"):
        table.add_column(title)
    for name in sorted(MODULES):
        found = experiment_named(name)
        more = f"; if asked for, {', '.join(found.on_request)}" if found.on_request else ""
        table.add_row(name, found.shows, ", ".join(found.tasks) + more)
    Console().print(table)
    return 0


def run_experiment(name: str, options: Options) -> int:
    """Run what is left of an experiment. After an interrupt the same command goes on.

    Raises:
        InputError: there is none of this name, or its options do not fit, or its folder cannot be written.
        KeyboardInterrupt: interrupted.
    """
    console = Console()
    experiment = experiment_named(name)
    try:
        experiment.result(options, lambda line: console.print(line, highlight=False, soft_wrap=True))
    except KeyboardInterrupt:
        console.print(f"interrupted; the same command goes on from {options.out}", highlight=False)
        raise
    except OSError as error:
        raise InputError(f"cannot write to {options.out} ({error}); give another --out") from error
    for kind in ("json", "png"):
        console.print(options.out / f"{name}.{kind}", highlight=False, soft_wrap=True)
    return 0
