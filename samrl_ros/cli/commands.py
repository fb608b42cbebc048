"""The commands of `samrl`, each in a file of this folder; loaded when used, so that `--help` is quick."""

from __future__ import annotations

import typer

from samrl_ros.cli.options import add_command, add_group

COMMANDS = (  # name, module:function in this folder, help
    (
        "cell",
        "cell:run_with_node_arguments",
        "Run the two-arm cell on a task, and leave a bag, a summary and a picture.",
    ),
    (
        "replay",
        "replay:replay_bag",
        "Run the nodes' handlers over a bag in recorded order, or play it over DDS.",
    ),
    ("estop", "estop:estop", "Stop both arms of the running cell at once; --reset lets them go on."),
    (
        "run-report",
        "run_report:report_run",
        "Make the page and the video of a run anew, also of an interrupted one.",
    ),
    ("excite", "excite:excite", "Play excitation trajectories on the cell, into bags that can be diagnosed."),
    (
        "diagnose",
        "diagnose:diagnose_bags",
        "Say where simulation and recordings differ, which effect causes it, and how far the gap shrinks.",
    ),
    (
        "train",
        "train:train_task",
        "Learn actor and sensing-aware Q of a task in the model, from nothing; resumable.",
    ),
    (
        "identify",
        "identify:identify_pushes",
        "Identify mass, inertia and friction of a pushed disc, with intervals.",
    ),
    ("scan", "scan:scan", "Fuse RGB-D views with masks and camera poses into a closed, coloured mesh."),
    (
        "experiment",
        "experiment:run_experiment",
        "Make one table or figure: cases, JSON and a picture; resumable.",
    ),
    (
        "reproduce",
        "reproduce:reproduce_all",
        "Train all networks and make all tables and figures, on all cores and GPUs; resumable.",
    ),
    (
        "effects",
        "effects:show_effects",
        "List the effects that the diagnosis knows: formula, parameters, ranges, source, excitation.",
    ),
    (
        "interfaces",
        "interfaces:build_interfaces",
        "Build the project's ROS 2 interfaces into this environment.",
    ),
    (
        "calibrate",
        "calibrate:run_calibration",
        "Calibrate camera in flange, or one arm's base in the other's, from recorded poses.",
    ),
    (
        "preflight",
        "preflight:preflight",
        "Check the drivers of a real cell before anything moves: names, limits, clocks, frames, rates.",
    ),
    (
        "doctor",
        "doctor:doctor",
        "Check whether the cell can run here, and say what to do where not; exit code 1 on a problem.",
    ),
)
GROUPS = (  # name, module:app in this folder, help
    ("bag", "bag:bag_app", "Look into bags and repair them."),
    ("bench", "bench:bench_app", "Measure."),
    ("forge", "forge:forge_app", "Sealed worlds for a blind test of the diagnosis: make, diagnose, score."),
)

app = typer.Typer(
    help="A two-arm cell that learns manipulation with few real trials,"
    " and names why simulation and cell differ.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

for _name, _target, _help in COMMANDS:
    add_command(app, _name, f"samrl_ros.cli.{_target}", _help)
for _name, _target, _help in GROUPS:
    add_group(app, _name, f"samrl_ros.cli.{_target}", _help)
