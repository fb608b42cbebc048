"""`samrl excite`: excitation trajectories played on the cell, into bags."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, TextColumn
from rich.table import Table

from samrl_core.cell.excitation import KINDS, SETS, Run, TrajectoryFile, file_runs, set_run
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.robot import ROLES, CellSpec
from samrl_core.cell.tasks import DEFAULT_TASK, task_named
from samrl_core.cell.world import DEFAULT_WORLD
from samrl_core.common.errors import InputError
from samrl_ros.cell.excite_cell import CellPlayer
from samrl_ros.cli.cell.excite_camera import record_views
from samrl_ros.contract.exit_codes import INTERRUPTED, OK
from samrl_ros.recordings.write import write_recording

CAMERA = "camera"  # the set of views


@dataclass(frozen=True)
class ExciteOptions:
    """Options of `samrl excite`."""

    trajectories: Annotated[
        tuple[Path, ...], typer.Argument(help="Trajectory files (YAML), as a diagnosis proposes them.")
    ] = ()
    sets: Annotated[
        str | None,
        typer.Option(
            "--set",
            help="all, A (slow), B (multisine) or C (task-like, held out); camera: views of both arms.",
        ),
    ] = None
    scene: Annotated[str, typer.Option(help="Task whose object stands before the camera (--set camera).")] = (
        "peg_insertion"
    )
    arm: Annotated[str | None, typer.Option(help="tool_arm (default) or camera_arm.")] = None
    out: Annotated[Path, typer.Option(help="Folder for the bags; existing bags are not replaced.")] = Path(
        "out/excite"
    )
    seed: Annotated[int, typer.Option(help="Of the sets' motions and the world's noise.", min=0)] = 0
    duration: Annotated[float, typer.Option(help="Length of each set in seconds.", min=1.0, max=600.0)] = 15.0
    world: Annotated[str, typer.Option(help="pybullet, or mock for piping tests.")] = DEFAULT_WORLD
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = DEFAULT_CELL
    kinds: Annotated[bool, typer.Option("--list", help="Only list the kinds of trajectory file.")] = False


def excite(options: ExciteOptions) -> int:
    """Play the sets, or trajectory files, and leave one bag of each in `out`; returns the exit code.

    A bag has its name only when it is complete.

    Raises:
        InputError: a file that is refused, an arm that does not fit it, or a bag that exists.
        LimitError: a motion that the arm must not make.
    """
    if options.kinds:
        Console().print(kinds_table())
        return OK
    if (options.sets or "").lower() == CAMERA:
        return _excite_camera(options)
    task, cell, out = task_named(DEFAULT_TASK), cell_named(options.cell), options.out
    runs = _runs(options, cell)
    targets = [
        (out / role / f"{run.name}.mcap" if _mixed(runs) else out / f"{run.name}.mcap") for role, run in runs
    ]
    for path in targets:
        if path.exists():
            raise InputError(f"{path} exists; choose another --out or move it away")
    console = Console(width=None if sys.stdout.isatty() else 120)
    table = Table(title="recordings")
    for column in ("bag", "arm", "length", "stiffness", "load", "farthest from command"):
        table.add_column(column, no_wrap=column == "bag")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with Progress(
            *Progress.get_default_columns(), TextColumn("{task.fields[what]}"), console=console
        ) as bar:
            for (role, run), path in zip(runs, targets, strict=True):
                shown = bar.add_task(escape(run.name), total=None, what="")

                def progress(what: str, done: float, total: float, shown=shown) -> None:
                    bar.update(shown, completed=done, total=total, what=escape(what))

                recording = CellPlayer(role, task, cell, options.world, options.seed).record(run, progress)
                bar.update(shown, what="writing")
                write_recording(recording, path)
                bar.update(shown, what="done")
                assert recording.states.position is not None and run.command.position is not None
                error = abs(recording.states.position - run.command.position).max(axis=0)
                worst = int(error.argmax())
                share = run.controller.stiffness[worst] / cell.arm(role).controller.stiffness[worst]
                table.add_row(
                    str(path),
                    role,
                    f"{recording.duration:.1f} s",
                    f"{share:.0%}",
                    f"+{run.extra_mass:g} kg" if run.extra_mass else "nominal",
                    f"{error[worst]:.4f} rad ({recording.arm.joints[worst]})",
                )
    except KeyboardInterrupt:
        complete = ", ".join(str(path) for path in targets if path.exists()) or "none"
        console.print(f"interrupted; complete recordings: {complete}", highlight=False)
        return INTERRUPTED
    console.print(table)
    return OK


def _excite_camera(options: ExciteOptions) -> int:
    if options.trajectories or options.arm:
        raise InputError("--set camera moves both arms from views that it chooses; leave files and --arm out")
    console = Console(width=None if sys.stdout.isatty() else 120)
    table = Table(title="recordings")
    for column in ("bag", "expected to add"):
        table.add_column(column, no_wrap=column == "bag")
    try:
        with console.status("") as status:
            made = record_views(
                options.scene, options.cell, options.world, options.seed, options.duration, options.out,
                status.update,
            )  # fmt: skip
    except KeyboardInterrupt:
        complete = ", ".join(str(path) for path in sorted(options.out.glob("*.mcap"))) or "none"
        console.print(f"interrupted; complete recordings: {complete}", highlight=False)
        return INTERRUPTED
    for path, nat in made:
        table.add_row(str(path), f"{nat:.1f} nat" if nat > 0 else "held out")
    console.print(table)
    return OK


def kinds_table() -> Table:
    """The kinds of trajectory file, for `--list`."""
    table = Table(title="kinds of trajectory file")
    table.add_column("kind", no_wrap=True)
    table.add_column("what it shows")
    table.add_column("parameters: default [unit]")
    for name, kind in KINDS.items():
        values = (
            f"{k}: {list(p.default) if isinstance(p.default, tuple) else p.default} \\[{p.unit}]"
            for k, p in kind.parameters.items()
        )
        table.add_row(name, kind.shows, ", ".join(values))
    return table


def _mixed(runs: list[tuple[str, Run]]) -> bool:
    return len({role for role, _ in runs}) > 1


def _runs(options: ExciteOptions, cell: CellSpec) -> list[tuple[str, Run]]:
    arm, which = options.arm, options.sets
    if arm is not None and arm not in ROLES:
        raise InputError(f"--arm is {arm!r}; choose {' or '.join(ROLES)}")
    choices = {"all": "ABC", "ALL": "ABC"} | {letter: letter for letter in SETS}
    if which is not None and which.upper() not in choices:
        raise InputError(f"--set is {which!r}; choose all, {', '.join(SETS)}, or {CAMERA}")
    loads = nominal_payloads(cell, task_named(DEFAULT_TASK).scene(cell).tool)
    runs: list[tuple[str, Run]] = []
    if which is not None or not options.trajectories:
        role = arm or "tool_arm"
        for letter in choices[(which or "all").upper()]:
            motion = set_run(letter, cell.arm(role), loads[role], options.seed, options.duration)
            runs.append((role, motion))
    for path in options.trajectories:
        file = TrajectoryFile.read(path)
        if arm not in (None, file.arm):
            raise InputError(
                f"{path} is for {file.arm}, --arm says {arm}; leave --arm out or change the file"
            )
        try:
            made = file_runs(path.stem, file, cell.arm(file.arm), loads[file.arm])
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        runs.extend((file.arm, run) for run in made)
    names = [(role, run.name) for role, run in runs]
    if doubled := sorted({name for role, name in names if names.count((role, name)) > 1}):
        raise InputError(f"two trajectories would be recorded as {doubled}; rename one of the files")
    return runs
