"""`samrl replay`: handlers over a recorded bag, or the bag over DDS."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_file
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.exit_codes import OK
from samrl_ros.contract.topics import cell_topic
from samrl_ros.hosting.ros_check import require_ros
from samrl_ros.hosting.threads import one_thread_per_library

DEFAULT_NODES = ("model_updater", "view_planner", "policy", "manipulator", "residual_trainer", "supervisor")
COMPARED = frozenset(
    cell_topic(t) for t in ("model_updater/state", "view_planner/target", "policy/nominal_action")
)


@dataclass(frozen=True)
class ReplayOptions:
    """Options of `samrl replay`."""

    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file.")]
    out: Annotated[Path | None, typer.Option(help="Write the report there as JSON.")] = None
    nodes: Annotated[str, typer.Option(help="Comma-separated nodes to run.")] = ""
    publish: Annotated[bool, typer.Option("--publish", help="Play over DDS with /clock instead.")] = False
    rate: Annotated[float, typer.Option(help="Speed of --publish, 1 is as recorded.", min=0.01)] = 1.0


def replay_bag(options: ReplayOptions) -> int:
    """Replay in process, or publish over DDS; returns the exit code.

    Raises:
        InputError: no bag, unknown nodes, or a report that is there already.
    """
    bag, out = options.bag, options.out
    names = tuple(name for name in options.nodes.split(",") if name) or DEFAULT_NODES
    require_ros()
    one_thread_per_library()
    console = Console(width=None if sys.stdout.isatty() else 120)  # a pipe has no width to respect
    if options.publish:
        from samrl_ros.bags.play import publish as play

        play(open_bag(bag), options.rate)
        return OK
    if out is not None and out.exists():
        raise InputError(f"{out} exists; choose another --out")
    from samrl_ros.cell.replay import RecordingOutbox, replay
    from samrl_ros.nodes.registry import entry

    settings = recorded_settings(bag)
    make = {}
    for name in names:
        node = entry(name)

        def factory(outbox: RecordingOutbox, node=node, name=name):
            return node.behaviour(node.settings(**settings.get(name, {})), outbox)

        make[name] = factory
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task("replaying", total=None)
        report = replay(bag, make, COMPARED, lambda d, t: progress.update(bar, completed=d, total=t))  # ty: ignore[invalid-argument-type]
    table = Table(title=f"replay of {bag}: {report.messages} messages, outputs {report.digest[:16]}")
    table.add_column("topic", no_wrap=True, overflow="fold")  # names are what people look for
    for column in ("recorded", "replayed", "largest difference", "sha256"):
        table.add_column(column, justify="right")
    for topic, row in report.outputs.items():
        difference = row.get("largest_difference")
        text = "-" if difference is None else f"{difference:.3g}"
        table.add_row(topic, str(row["recorded"]), str(row["replayed"]), text, row["sha256"][:12])
    console.print(table)
    if report.truncated:
        console.print("[yellow]the bag is cut off: replayed up to the cut; `samrl bag repair` completes it")
    if out is not None:
        report.write(out)
        console.print(f"report: {out}")
    return OK


def recorded_settings(bag: Path) -> dict[str, dict[str, object]]:
    """The settings that the nodes ran with, from `params.yaml` beside the bag; defaults without one."""
    import dataclasses

    from samrl_core.common.text_files import parse_yaml, read_text
    from samrl_ros.cell.parameter_file import with_present_names
    from samrl_ros.nodes.registry import behaviour_nodes

    folder = bag if bag.is_dir() else bag.parent
    file = folder.parent / "params.yaml"
    if not is_file(file):
        return {}
    data = parse_yaml(read_text(file, "the run's parameters"), str(file)) or {}
    given: dict[str, dict[str, object]] = {}
    for node, body in data.items() if isinstance(data, dict) else [("", data)]:
        values = body.get("ros__parameters") if isinstance(body, dict) else None
        if not isinstance(node, str) or not isinstance(values, dict):
            raise InputError(
                f"{file} is no ROS parameter file: {node!r} holds no ros__parameters; move it away"
            )
        given[node.removeprefix("/cell/")] = values
    # Runs from before `policy` was a node have its settings where the view planner's are.
    given.setdefault("policy", given.get("view_planner", {}))
    given, _ = with_present_names(given)
    settings: dict[str, dict[str, object]] = {}
    for name, node in behaviour_nodes().items():
        known = {f.name for f in dataclasses.fields(node.settings)}  # ty: ignore[invalid-argument-type]
        settings[name] = {k: v for k, v in given.get(name, {}).items() if k in known}
    # Runs from before this was a setting, which are known by its absence, ended with the first such image.
    settings["supervisor"].setdefault("done_confirmations", 1)
    # They updated anew when an update that was done was asked for again.
    settings["model_updater"].setdefault("repeat_answers", False)
    # They kept four images after a request.
    for name in ("view_planner", "policy"):
        settings[name].setdefault("images_kept", 4)
    # They ended with an emergency stop, in which the manipulator went on.
    settings["supervisor"].setdefault("wait_for_reset", False)
    settings["manipulator"].setdefault("heed_stops", False)
    return settings
