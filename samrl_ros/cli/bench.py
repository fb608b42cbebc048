"""`samrl bench`: one command per benchmark."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from samrl_core.common.errors import InputError
from samrl_ros.cell.soak.options import SoakOptions
from samrl_ros.contract.settings import REAL_TIME_FACTOR

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
    real_time_factor: Annotated[
        float, typer.Option(help="Upper bound, 0 for none.", min=0.0)
    ] = REAL_TIME_FACTOR,
) -> None:
    """Run the cell, every node in its own process: CPU share per node, ages, loop time per action."""
    from samrl_ros.cell.bench.cell_bench import bench_cell

    raise typer.Exit(bench_cell(out, seed, episodes, real_time_factor))


@bench_app.command("soak")
def soak(
    out: Annotated[
        Path, typer.Option(help="Folder of the soak; given again, an interrupted one goes on.")
    ] = SoakOptions.out,
    hours: Annotated[float, typer.Option(help="Wall time of all turns.", min=0.01)] = SoakOptions.hours,
    tasks: Annotated[str, typer.Option(help="Comma-separated tasks.")] = ",".join(SoakOptions.tasks),
    episodes: Annotated[int, typer.Option(help="Episodes of a turn.", min=1)] = SoakOptions.episodes,
    seed: Annotated[int, typer.Option(help="Seed of the first episode.", min=0)] = SoakOptions.seed,
    layout: Annotated[str, typer.Option(help="As of `samrl cell`.")] = SoakOptions.layout,
    keep_bags: Annotated[bool, typer.Option("--keep-bags", help="60 MB an episode.")] = SoakOptions.keep_bags,
) -> None:
    """Run episodes of all tasks in turn for hours: growth of memory, handles, latencies, losses."""
    from samrl_ros.cell.soak.command import soak_cell

    names = tuple(name for name in tasks.split(",") if name)
    raise typer.Exit(soak_cell(SoakOptions(out, hours, names, episodes, seed, layout, keep_bags)))


@bench_app.command("actions")
def actions(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run of `samrl cell`.")],
) -> None:
    """Split the wall time of each action of a run into update, view, act and move."""
    from samrl_ros.cell.bench.action_bench import bench_actions

    raise typer.Exit(bench_actions(run))


ModelOut = Annotated[Path, typer.Option("--out", help="Folder of the results; they must not be there yet.")]
Rounds = Annotated[int, typer.Option(help="Turns of every alternative; the median counts.", min=1)]
Device = Annotated[str, typer.Option(help="torch's name of the device whose rates are measured.")]
Batches = Annotated[
    list[int] | None, typer.Option("--batch", help="Size of a batch; repeat for more.", min=1)
]


def _device(name: str) -> str:
    import torch

    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError) as error:
        raise InputError(
            f"device {name}: {str(error).splitlines()[0]}; --device cpu runs everywhere"
        ) from error
    return name


@bench_app.command("renderer")
def renderer(
    out: ModelOut = Path("out/bench-model"), rounds: Rounds = 5, device: Device = "cpu", batch: Batches = None
) -> None:
    """The renderer beside Mitsuba (gradients at equal error) and PyBullet's TinyRenderer (images)."""
    from samrl_ros.cell.bench.model_bench import measure, renderer_parts

    batches = batch or [1, 16, 64]
    raise typer.Exit(measure("renderer", renderer_parts(rounds, batches, _device(device)), out))


@bench_app.command("physics")
def physics(
    out: ModelOut = Path("out/bench-model"),
    rounds: Rounds = 5,
    device: Device = "cpu",
    batch: Batches = None,
    nimble: Annotated[
        Path | None,
        typer.Option(help="Python of an environment with nimblephysics and numpy<2; left out without it."),
    ] = None,
) -> None:
    """The physics beside MuJoCo, Newton and Nimble: a free chain, a sliding disc."""
    from samrl_ros.cell.bench.model_bench import measure, physics_parts

    batches = batch or [1, 64]
    raise typer.Exit(measure("physics", physics_parts(rounds, batches, _device(device), nimble), out))


@bench_app.command("emd")
def emd(out: ModelOut = Path("out/bench-model"), rounds: Rounds = 9) -> None:
    """The exact Earth Mover's Distance beside POT and GeomLoss."""
    from samrl_ros.cell.bench.model_bench import emd_parts, measure

    raise typer.Exit(measure("emd", emd_parts(rounds), out))


@bench_app.command("pictures")
def pictures(
    instance: Annotated[
        list[str] | None,
        typer.Option(help="A cell instance; repeat for more. Without it, three typical ones."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of pictures.json and pictures.png.")] = Path(
        "out/pictures"
    ),
    rounds: Rounds = 60,
    seed: Annotated[int, typer.Option(help="Seed of the episodes.", min=0)] = 0,
) -> None:
    """Simulated camera images of cell instances: time beside the nominal cell's, and a sheet of them."""
    import json

    from samrl_core.common.files import write_whole
    from samrl_core.studies.speed.camera_pictures import time_pictures

    names = instance or [f"typical:{k}" for k in (1, 4, 8)]
    out.mkdir(parents=True, exist_ok=True)
    found = time_pictures(names, rounds, out / "pictures.png", seed)
    write_whole(out / "pictures.json", json.dumps(found, indent=1) + "\n")
    for task, rows in found.items():
        for name, row in rows.items():
            typer.echo(f"{task:20} {name:24} {row['ms']:6.2f} ms  {row['ratio']:.2f}")
    typer.echo(f"picture: {out / 'pictures.png'}")
