"""The commands of `samrl`. Heavy imports happen inside them, so that `--help` is quick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from samrl_core.cell.robots.cells import DEFAULT_CELL
from samrl_ros.cli.options import add_command, add_group

app = typer.Typer(
    help="A two-arm cell that learns manipulation with few real trials,"
    " and names why simulation and cell differ.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


add_command(
    app,
    "cell",
    "samrl_ros.cli.cell:run_with_node_arguments",
    "Run the two-arm cell on a task, and leave a bag, a summary and a picture.",
)
add_command(
    app,
    "replay",
    "samrl_ros.cli.replay:replay_bag",
    "Run the nodes' handlers over a bag in recorded order, or play it over DDS.",
)
add_command(
    app,
    "estop",
    "samrl_ros.cli.estop:estop",
    "Stop both arms of the running cell at once; --reset lets them go on.",
)
add_command(
    app,
    "run-report",
    "samrl_ros.cli.run_report:report_run",
    "Make the page and the video of a run anew, also of an interrupted one.",
)


@app.command()
def excite(
    trajectories: Annotated[
        list[Path] | None, typer.Argument(help="Trajectory files (YAML), as a diagnosis proposes them.")
    ] = None,
    sets: Annotated[
        str | None, typer.Option("--set", help="all, A (slow), B (multisine) or C (task-like, held out).")
    ] = None,
    arm: Annotated[str | None, typer.Option(help="tool_arm (default) or camera_arm.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the bags; existing bags are not replaced.")] = Path(
        "out/excite"
    ),
    seed: Annotated[int, typer.Option(help="Of the sets' motions and the world's noise.", min=0)] = 0,
    duration: Annotated[float, typer.Option(help="Length of each set [s].", min=1.0, max=600.0)] = 15.0,
    world: Annotated[str, typer.Option(help="pybullet, or mock for piping tests.")] = "pybullet",
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = DEFAULT_CELL,
    kinds: Annotated[bool, typer.Option("--list", help="Only list the kinds of trajectory file.")] = False,
) -> None:
    """Play excitation trajectories on the cell, into bags that can be diagnosed."""
    from samrl_ros.cli import excite as excite_command

    if kinds:
        Console().print(excite_command.kinds_table())
        return
    code = excite_command.excite(tuple(trajectories or ()), sets, arm, out, seed, duration, world, cell)
    raise typer.Exit(code)


@app.command()
def diagnose(
    bags: Annotated[
        list[Path], typer.Argument(help="Bags to fit (.mcap, bag folders, or a folder of bags).")
    ],
    held_out: Annotated[
        list[Path] | None, typer.Option(help="Bags never fitted; without it, the last of several is one.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of report.json and report.html.")] = Path("out/diagnosis"),
    arm: Annotated[str | None, typer.Option(help="tool_arm or camera_arm; else the one that moves.")] = None,
    urdf: Annotated[Path | None, typer.Option(help="Nominal model, in place of the bags' own.")] = None,
    tolerances: Annotated[Path | None, typer.Option(help="Tolerances of the nominal model (YAML).")] = None,
    library: Annotated[Path | None, typer.Option(help="Families that may be named (YAML list).")] = None,
    seed: Annotated[int, typer.Option(help="Of bootstrap and sampling.", min=0)] = 0,
    null_worlds: Annotated[
        int, typer.Option(help="Simulate as many worlds without an effect for the threshold.", min=0)
    ] = 0,
    fail_on_gap: Annotated[bool, typer.Option("--fail-on-gap", help="Exit with 4 on a gap.")] = False,
) -> None:
    """Say where simulation and recordings differ, which effect causes it, and how far the gap shrinks."""
    from samrl_ros.cli.diagnose import DiagnoseOptions, diagnose_bags

    options = DiagnoseOptions(
        tuple(bags),
        tuple(held_out or ()),
        out,
        arm,
        urdf,
        tolerances,
        library,
        seed,
        fail_on_gap,
        null_worlds,
    )
    raise typer.Exit(diagnose_bags(options))


add_command(
    app,
    "train",
    "samrl_ros.cli.train:train_task",
    "Learn actor and sensing-aware Q of a task in the model, from nothing; resumable.",
)


add_command(
    app,
    "identify",
    "samrl_ros.cli.identify:identify_pushes",
    "Identify mass, inertia and friction of a pushed disc, with intervals.",
)
add_command(
    app,
    "scan",
    "samrl_ros.cli.scan:scan",
    "Fuse RGB-D views with masks and camera poses into a closed, coloured mesh.",
)


@app.command()
def experiment(
    name: Annotated[str | None, typer.Argument(help="Which; without it, a list.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of this experiment; out/NAME by default. Goes on from it.")
    ] = None,
    task: Annotated[list[str] | None, typer.Option(help="Only this task; may be repeated.")] = None,
    count: Annotated[
        int, typer.Option(help="Episodes or states per condition, or real steps; 0: the experiment's.", min=0)
    ] = 0,
    seed: Annotated[int, typer.Option(help="Of the first episode or state.", min=0)] = 0,
    device: Annotated[str, typer.Option(help="Of batched rendering: cpu, or cuda:0.")] = "cpu",
    workers: Annotated[int, typer.Option(help="Processes; 0: free cores.", min=0)] = 0,
    weights: Annotated[
        Path | None, typer.Option(help="Folder of trained networks, in place of the package's.")
    ] = None,
    condition: Annotated[
        list[str] | None, typer.Option(help="Only this condition of those compared; may be repeated.")
    ] = None,
) -> None:
    """Make one table or figure: cases, JSON and a picture; resumable."""
    from samrl_core.studies.experiment import Options
    from samrl_ros.cli.experiment import list_experiments, run_experiment

    if name is None:
        raise typer.Exit(list_experiments())
    options = Options(
        out or Path("out") / name,
        tuple(task or ()),
        count,
        seed,
        device,
        workers,
        weights,
        tuple(condition or ()),
    )
    raise typer.Exit(run_experiment(name, options))


@app.command()
def reproduce(
    out: Annotated[Path, typer.Option(help="Folder of everything that is made. Goes on from it.")] = Path(
        "out/reproduce"
    ),
    trained: Annotated[
        Path | None,
        typer.Option(help="Networks that need not be trained, as msgs_docs/training has them."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="Jobs whose name holds this, and what they need; repeatable.")
    ] = None,
    count: Annotated[
        int, typer.Option(help="Episodes or states per condition; 0: each experiment's own.", min=0)
    ] = 0,
    steps: Annotated[int, typer.Option(help="Real steps of sample_efficiency; 0: its own.", min=0)] = 0,
    list_them: Annotated[bool, typer.Option("--list", help="List the jobs and run none.")] = False,
) -> None:
    """Train all networks and make all tables and figures, on all cores and GPUs; resumable."""
    from samrl_ros.cli.reproduce import reproduce_all

    raise typer.Exit(reproduce_all(out, trained, tuple(only or ()), count, steps, list_them))


@app.command()
def effects(
    family: Annotated[str | None, typer.Argument(help="One family in full; without it, the table.")] = None,
) -> None:
    """List the effects that the diagnosis knows: formula, parameters, ranges, source, excitation."""
    from samrl_ros.cli.effects import show_effects

    show_effects(family, Console())


@app.command()
def interfaces() -> None:
    """Build the project's ROS 2 interfaces into this environment."""
    from samrl_ros.interfaces.build import main as build

    build()


add_command(
    app,
    "calibrate",
    "samrl_ros.cli.calibrate:run_calibration",
    "Calibrate camera in flange, or one arm's base in the other's, from recorded poses.",
)
add_command(
    app,
    "preflight",
    "samrl_ros.cli.preflight:preflight",
    "Check the drivers of a real cell before anything moves: names, limits, clocks, frames, rates.",
)
add_command(
    app,
    "doctor",
    "samrl_ros.cli.doctor:doctor",
    "Check whether the cell can run here, and say what to do where not; exit code 1 on a problem.",
)
add_group(app, "bag", "samrl_ros.cli.bag:bag_app", "Look into bags and repair them.")
add_group(app, "bench", "samrl_ros.cli.bench:bench_app", "Measure.")
add_group(
    app,
    "forge",
    "samrl_ros.cli.forge:forge_app",
    "Sealed worlds for a blind test of the diagnosis: make, diagnose, score.",
)
