"""The commands of `samrl`, a file each below this folder; loaded when used, so that `--help` is quick."""

from __future__ import annotations

from typing import Annotated

import typer

from samrl_core.common.version import samrl_version
from samrl_ros.cli.options import add_command, add_group

COMMANDS = (  # name, room.module:function, help
    (
        "cell",
        "cell.run:run_with_node_arguments",
        "Run the two-arm cell on a task, and leave a bag, a summary and a picture.",
    ),
    (
        "replay",
        "cell.replay:replay_bag",
        "Run the nodes' handlers over a bag in recorded order, or play it over DDS.",
    ),
    ("estop", "cell.estop:estop", "Stop both arms of the running cell at once; --reset lets them go on."),
    (
        "run-report",
        "cell.run_report:report_run",
        "Make the page and the video of a run anew, also of an interrupted one.",
    ),
    (
        "excite",
        "cell.excite:excite",
        "Play excitation trajectories on the cell, into bags that can be diagnosed.",
    ),
    (
        "diagnose",
        "diagnosis.diagnose:diagnose_bags",
        "Say where simulation and recordings differ, which effect causes it, and how far the gap shrinks.",
    ),
    (
        "train",
        "learning.train:train_task",
        "Learn actor and sensing-aware Q of a task in the model, from nothing; resumable.",
    ),
    (
        "identify",
        "model.identify:identify_pushes",
        "Identify mass, inertia and friction of a pushed disc, with intervals.",
    ),
    ("scan", "model.scan:scan", "Fuse RGB-D views with masks and camera poses into a closed, coloured mesh."),
    (
        "experiment",
        "learning.experiment:run_experiment",
        "Make one table or figure: cases, JSON and a picture; resumable.",
    ),
    (
        "reproduce",
        "learning.reproduce:reproduce_all",
        "Train all networks and make all tables and figures, on all cores and GPUs; resumable.",
    ),
    (
        "effects",
        "diagnosis.effects:show_effects",
        "List the effects that the diagnosis knows: formula, parameters, ranges, source, excitation.",
    ),
    (
        "interfaces",
        "interfaces:build_interfaces",
        "Build the project's ROS 2 interfaces into this environment.",
    ),
    (
        "calibrate",
        "cell.calibrate:run_calibration",
        "Calibrate camera in flange, or one arm's base in the other's, from recorded poses.",
    ),
    (
        "preflight",
        "cell.preflight:preflight",
        "Check the drivers of a real cell before anything moves: names, limits, clocks, frames, rates.",
    ),
    (
        "doctor",
        "doctor:doctor",
        "Check whether the cell can run here, and say what to do where not; exit code 1 on a problem.",
    ),
)
GROUPS = (  # name, room.module:app, help
    ("bag", "bag:bag_app", "Look into bags and repair them."),
    ("bench", "bench:bench_app", "Measure."),
    (
        "forge",
        "blind_test.forge:forge_app",
        "Sealed worlds for a blind test of the diagnosis: make, diagnose, score.",
    ),
)

app = typer.Typer(
    help="A two-arm cell that learns manipulation with few real trials,"
    " and names why simulation and cell differ.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _say_version(asked: bool) -> None:
    if asked:
        typer.echo(f"samrl {samrl_version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version, and exit."),
    ] = False,
) -> None:
    """Options beside the commands; what is asked for is said by its own callback."""


for _name, _target, _help in COMMANDS:
    add_command(app, _name, f"samrl_ros.cli.{_target}", _help)
for _name, _target, _help in GROUPS:
    add_group(app, _name, f"samrl_ros.cli.{_target}", _help)
