"""Options of `samrl diagnose`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from samrl_core.cell.tasks import DEFAULT_TASK
from samrl_ros.cli.progress import SIDE_BY_SIDE
from samrl_ros.log_import.draft.guess import EFFORT_HELP, Effort

XACRO_HELP = "Value of an argument of a xacro model, NAME:=VALUE."


@dataclass(frozen=True)
class DiagnoseOptions:
    """Options of `samrl diagnose`."""

    bags: Annotated[
        tuple[Path, ...], typer.Argument(help="Bags to fit (or a folder of bags), or logs of other tools.")
    ] = ()
    held_out: Annotated[
        tuple[Path, ...],
        typer.Option(help="Bags never fitted; without it, the last of several is one."),
    ] = ()
    out: Annotated[Path, typer.Option(help="Folder of report.json and report.html.")] = Path("out/diagnosis")
    arm: Annotated[str | None, typer.Option(help="tool_arm or camera_arm; else the one that moves.")] = None
    mapping: Annotated[
        Path | None,
        typer.Option(help="What the columns of logs mean (msgs_docs/guide/import.md); else it is drafted."),
    ] = None
    data: Annotated[
        Path | None,
        typer.Option(help="With --mapping: folder its paths count from; without it, the mapping's."),
    ] = None
    urdf: Annotated[
        Path | None,
        typer.Option(
            "--urdf", "--model", help="Nominal model, in place of the bags' own: URDF, xacro or MJCF."
        ),
    ] = None
    xacro_arg: Annotated[tuple[str, ...], typer.Option(help=XACRO_HELP)] = ()
    tolerances: Annotated[Path | None, typer.Option(help="Tolerances of the nominal model (YAML).")] = None
    library: Annotated[Path | None, typer.Option(help="Families that may be named (YAML list).")] = None
    seed: Annotated[int, typer.Option(help="Of bootstrap and sampling.", min=0)] = 0
    null_worlds: Annotated[
        int, typer.Option(help="Simulate as many worlds without an effect for the threshold.", min=0)
    ] = 0
    fail_on_gap: Annotated[bool, typer.Option("--fail-on-gap", help="Exit with 4 on a gap.")] = False
    track: Annotated[
        tuple[str, ...],
        typer.Option(help="Say how large FAMILY@PLACE is, named or not; repeat for more."),
    ] = ()
    many: Annotated[
        Path | None,
        typer.Option(help="Diagnose every set of recordings at DIR/ROBOT/DAY, and what changed over days."),
    ] = None
    workers: Annotated[int, typer.Option(help="With --many: processes side by side.", min=1)] = SIDE_BY_SIDE
    ray: Annotated[bool, typer.Option("--ray", help="With --many: on a Ray cluster (extra cluster).")] = False
    export: Annotated[
        tuple[str, ...],
        typer.Option(help="Write the correction for mujoco, urdf, pybullet, isaaclab or gazebo."),
    ] = ()
    randomise: Annotated[
        bool, typer.Option("--randomise", help="With --export: posterior ranges for domain randomisation.")
    ] = False
    watch: Annotated[
        bool, typer.Option("--watch", help="Diagnose the running graph, window after window, until Ctrl-C.")
    ] = False
    window: Annotated[float, typer.Option(help="With --watch: length of a window in s.")] = 30.0
    windows: Annotated[int, typer.Option(help="With --watch: end after so many; 0: never.", min=0)] = 0
    keep: Annotated[int, typer.Option(help="With --watch: newest bags without a gap that stay.", min=0)] = 10
    apply: Annotated[
        bool,
        typer.Option("--apply", help="Write corrected description or calibration into OUT/apply."),
    ] = False
    camera: Annotated[
        bool, typer.Option("--camera", help="Diagnose the camera's images of these bags, not an arm.")
    ] = False
    scene: Annotated[
        str, typer.Option(help="With --camera: the task whose scene stands before the camera.")
    ] = DEFAULT_TASK
    sim: Annotated[
        Path | None,
        typer.Option(help="A log of your simulator: say where and when it leaves the machine's. No model."),
    ] = None
    effort: Annotated[Effort, typer.Option(help=f"Of logs of other tools: {EFFORT_HELP}")] = Effort.ask
