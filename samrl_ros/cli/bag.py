"""`samrl bag info`, `repair`, `view`, `draft` and `import`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there, require_there, write_whole
from samrl_ros.bags.info import describe, render
from samrl_ros.bags.reader import open_bag
from samrl_ros.bags.repair import default_destination, repair
from samrl_ros.hosting.ros_check import require_ros
from samrl_ros.log_import.draft.guess import EFFORT_HELP, Effort

bag_app = typer.Typer(help="Look into bags and repair them.", no_args_is_help=True)

BagPath = Annotated[Path, typer.Argument(metavar="BAG", help="Bag folder or .mcap file.")]


@bag_app.command("info")
def info(
    path: BagPath,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show what a bag holds: duration, topics, types, rates, and whether it is whole."""
    described = describe(open_bag(path))
    if as_json:
        typer.echo(json.dumps(described, indent=2))
    else:
        width = None if sys.stdout.isatty() else 160  # a pipe has no width to respect
        Console(width=width).print(render(described))


@bag_app.command("repair")
def repair_command(
    path: BagPath,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="New bag folder; without it, BAG_repaired.")
    ] = None,
) -> None:
    """Copy what can be read of a truncated or unclosed bag into a new, complete one."""
    destination = out if out is not None else default_destination(path)
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("copying", total=None)
        report = repair(
            path,
            destination,
            on_progress=lambda done, total: progress.update(task, completed=done, total=total),
        )
    typer.echo(f"{report.messages} messages up to {report.end_ns * 1e-9:.3f} s kept in {report.destination}")
    for line in report.damage:
        typer.echo(f"stopped at: {line} ({report.lost_bytes} bytes not readable in all)")


@bag_app.command("view")
def view_command(
    path: BagPath,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="New bag folder; without it, BAG_view.")
    ] = None,
) -> None:
    """Copy a bag for Foxglove, with clouds, differences, chosen views and the arms' meshes."""
    with Progress(console=Console(stderr=True), transient=True) as progress:
        require_ros()
        from samrl_ros.cell.viewer import view_file

        destination = out if out is not None else view_file.default_destination(path)
        task = progress.add_task("copying", total=None)
        added = view_file.write_view(
            path, destination, lambda done, total: progress.update(task, completed=done, total=total)
        )
    typer.echo(f"{destination}: {added} messages added; open its .mcap in Foxglove")


@bag_app.command("draft")
def draft_command(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Files of one recording, a bag, or a folder.")
    ],
    urdf: Annotated[
        Path | None,
        typer.Option("--urdf", "--model", metavar="FILE", help="Robot description: URDF, xacro or MJCF."),
    ] = None,
    xacro_arg: Annotated[
        list[str] | None, typer.Option("--xacro-arg", metavar="NAME:=VALUE", help="Of a xacro description.")
    ] = None,
    effort: Annotated[Effort, typer.Option("--effort", help=EFFORT_HELP)] = Effort.ask,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Mapping to write; without it, it is printed."),
    ] = None,
) -> None:
    """Draft a mapping for `samrl bag import`: entries with reasons, questions where nothing proves them."""
    from samrl_core.diagnosis.nominal_model.read_model import read_model
    from samrl_ros.log_import.devices import data_folder
    from samrl_ros.log_import.draft.any_draft import draft_any
    from samrl_ros.log_import.draft.places import name_by_path
    from samrl_ros.log_import.draft.writing import as_yaml
    from samrl_ros.recordings.described import xacro_values

    if out is not None and is_there(out):
        raise InputError(f"{out} exists already; choose another --out or move it away")
    require_there(*logs)
    given = xacro_values(xacro_arg or ())
    text = read_model(urdf, given).urdf if urdf is not None else None
    drafted = draft_any(logs, text, None if urdf is None else str(urdf.resolve()), effort)
    drafted.xacro_args = dict(given)
    folder = data_folder(drafted, logs[0])
    name_by_path(drafted, logs, folder)
    if out is not None:
        write_whole(out, as_yaml(drafted))
    if out is None:
        typer.echo(as_yaml(drafted), nl=False)
        return
    sure = sum(guess.sure for guess in drafted.guesses)
    resting = sum(bool(guess.asked_with) and not guess.question for guess in drafted.guesses)
    also = f", {resting} rest on what is asked" if resting else ""
    typer.echo(f"{out}: {sure} entries are sure, {len(drafted.questions)} ask{also}")
    for question in drafted.questions:
        typer.echo(f"  {question}")
    for each in drafted.would_tell:
        typer.echo(f"  left out: {each}")
    data = "" if folder.resolve() == out.parent.resolve() else f" --data {folder}"
    typer.echo(f"then: samrl diagnose --mapping {out}{data} --out report")


@bag_app.command("import")
def import_command(
    mapping: Annotated[Path, typer.Argument(metavar="MAPPING.yaml", help="What the logs' columns mean.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for the bags, one per recording.")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data", metavar="DIR", help="Folder that paths count from; without it, the mapping's."
        ),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Only say what each channel becomes; write nothing.")
    ] = False,
) -> None:
    """Turn logs of other tools into bags, by a YAML mapping alone (msgs_docs/guide/import.md)."""
    from samrl_ros.log_import.any_importer import import_any
    from samrl_ros.log_import.imported_files import INDEX

    if out is None and not check:
        raise typer.BadParameter("say where to write, or --check to write nothing", param_hint="--out")
    found = import_any(mapping, data if data is not None else mapping.parent, None if check else out)
    for each in found.made:
        typer.echo(f"{each.recording.name} ({each.role}, {found.system_of(each)})")
        for line in each.report:
            typer.echo(f"  {line}")
        for note in each.notes:
            typer.echo(f"  note: {note}")
    if out is not None and not check:
        typer.echo(f"{len(found.made)} recordings in {out}, their roles in {out / INDEX}")
