"""`samrl diagnose`: recordings in; report.json, report.html and ten lines in the terminal out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from samrl_core.cell.tasks import DEFAULT_TASK
from samrl_core.cell.types.arm_description import Tolerances
from samrl_core.cell.types.arm_recording import ArmRecording
from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.common.array_file import write_arrays
from samrl_core.common.errors import InputError
from samrl_core.common.files import is_there
from samrl_core.common.text_files import parse_json, read_text
from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.kinds.kind import Recording
from samrl_core.diagnosis.nominal_model.nominal_model import NominalModel
from samrl_core.diagnosis.recordings import check_held_out, check_recording, longest_whole, split
from samrl_core.diagnosis.recordings.motion_check import no_motion
from samrl_ros.cli.diagnosis.library import read_library
from samrl_ros.cli.progress import SIDE_BY_SIDE
from samrl_ros.contract.exit_codes import GAP_FOUND, INTERRUPTED, OK
from samrl_ros.log_import.draft.guess import EFFORT_HELP, Effort

XACRO_HELP = "Value of an argument of a xacro model, NAME:=VALUE."
NAMED = ("effect", "ambiguous", "none_of_mine")


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
    window: Annotated[float, typer.Option(help="With --watch: length of a window [s].")] = 30.0
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


def diagnose_bags(options: DiagnoseOptions) -> int:
    """Diagnose and write the report; the exit code of the contract.

    Raises:
        InputError: the recordings cannot be used; nothing was written.
    """
    from samrl_ros.cli.diagnosis.apply import apply
    from samrl_ros.cli.diagnosis.compare import compare
    from samrl_ros.cli.diagnosis.export import (
        check_targets,
        export_all,
        export_report,
        is_report,
        keep_correction,
    )
    from samrl_ros.recordings.described import model_of

    check_targets(options.export)
    if options.many is not None:
        return _many(options)
    if options.watch:
        return _watch(options)
    if not options.bags:
        raise InputError("no recording is named; give bags, a folder of bags or a log, or --many DIR")
    screen = Console()
    if options.sim is not None:
        if len(options.bags) != 1:
            raise InputError(f"--sim compares one log with another; {len(options.bags)} logs were given")
        compare(options.bags[0], options.sim, options.out, lambda path: _one_log(path, options), screen)
        return OK
    if is_report(options.bags):
        model = model_of(options.urdf, options.xacro_arg) if options.urdf else None
        export_report(options.bags[0], model, options.export, options.randomise, screen)
        return OK
    if (options.out / "report.json").exists():
        raise InputError(f"{options.out} has a report already; give another --out, reports are not replaced")
    from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
    from samrl_core.diagnosis.findings.tracking import checked_names
    from samrl_core.diagnosis.report.terminal import summary
    from samrl_core.diagnosis.report.write_report import write_report
    from samrl_core.diagnosis.selection.selection import SelectionSettings

    families = read_library(options.library) if options.library else None
    selection = SelectionSettings(null_simulations=options.null_worlds, cache=cache_folder() / "null_worlds")
    # What the user holds out stays held out; what was held out by default may be shared.
    settings = DiagnosisSettings(
        library=families,
        seed=options.seed,
        selection=selection,
        share_held_out=not options.held_out,
        track=checked_names(options.track),
    )
    try:
        with screen.status("reading recordings") as status:
            model = model_of(options.urdf, options.xacro_arg) if options.urdf else None
            fit, held_out, notes = load(options, model)
            if options.apply and any(isinstance(r, BodyRecording) for r in fit):
                raise InputError("--apply is for arms, poses, readings, images; of a body read report.json")
            for note in notes:
                screen.print(f"[yellow]note:[/] {escape(note)}", highlight=False, soft_wrap=True)
            diagnosis, far = diagnose(fit, held_out, settings, notes, status.update)
            status.update("writing the report")
            files = write_report(diagnosis, options.out)
            _write_resimulation(options.out, far.resimulations)
            made = far.correction
            correction = keep_correction(made, model, options.out) if isinstance(made, Correction) else None
            applied = apply(made, diagnosis, options.out) if options.apply else []
    except KeyboardInterrupt:
        screen.print("interrupted; nothing was written, the same command begins again", highlight=False)
        return INTERRUPTED
    for line in summary(diagnosis, [str(f) for f in files]):
        screen.print(escape(line), highlight=False, soft_wrap=True)
    for line in applied:
        screen.print(escape(line), highlight=False, soft_wrap=True)
    if options.export and correction is None:
        screen.print(f"nothing was named, so there is nothing to export to {', '.join(options.export)}")
    elif correction is not None:
        export_all(correction, options.export, options.out, options.randomise, screen)
    return GAP_FOUND if options.fail_on_gap and diagnosis.verdict in NAMED else OK


def _many(options: DiagnoseOptions) -> int:
    from samrl_ros.cli.diagnosis.many import diagnose_many

    if options.bags or options.held_out:
        raise InputError("--many takes its recordings from its folder; leave out other bags and --held-out")
    assert options.many is not None
    shared = _for_children(options)
    shared += ["--randomise"] if options.randomise else []
    return diagnose_many(options.many, options.out, shared, options.workers, options.ray, options.fail_on_gap)


def _watch(options: DiagnoseOptions) -> int:
    from samrl_ros.cli.diagnosis.watch import watch_graph

    if options.bags or options.held_out or options.sim is not None or options.apply or options.export:
        raise InputError(
            "--watch takes its recordings from the running graph; leave out bags, --held-out, --sim, --apply"
            " and --export, and diagnose a kept window with them later"
        )
    return watch_graph(
        options.out,
        _for_children(options),
        options.window,
        options.windows,
        options.keep,
        options.fail_on_gap,
    )


def _for_children(options: DiagnoseOptions) -> list[str]:
    """Arguments of a `samrl diagnose` that is started for one set of recordings."""
    shared: list[str] = ["--seed", str(options.seed), "--null-worlds", str(options.null_worlds)]
    shared += ["--effort", options.effort.value]
    for name in ("urdf", "tolerances", "library"):
        if (path := getattr(options, name)) is not None:
            shared += [f"--{name}", str(path.resolve())]
    shared += ["--arm", options.arm] if options.arm else []
    for name, values in (
        ("--xacro-arg", options.xacro_arg), ("--track", options.track), ("--export", options.export),
    ):  # fmt: skip
        shared += [text for value in values for text in (name, value)]
    return shared


def load(
    options: DiagnoseOptions, model: NominalModel | None = None
) -> tuple[Sequence[Recording], Sequence[Recording], list[str]]:
    """Recordings of one system by role, checked, with notes about them.

    Raises:
        InputError: no bag, bags that cannot be read or used, or held-out data that were fitted too.
    """
    from samrl_ros.cli.diagnosis.load_devices import load_device_files, load_device_logs
    from samrl_ros.log_import.foreign import runs_in
    from samrl_ros.recordings import read_tolerances
    from samrl_ros.recordings.described import described_by

    fit_paths, held_paths = _roles(options.bags, options.held_out)
    if options.camera:
        from samrl_ros.recordings.image_bag import load_image_bags

        return load_image_bags(fit_paths, held_paths, options.scene, options.tolerances)
    devices = load_device_files(fit_paths, held_paths, options.tolerances)
    if devices is None and model is None:
        devices = load_device_logs(options.bags, options.held_out, options.tolerances)
    if devices is not None:
        return devices
    fit_paths = [run for path in fit_paths for run in runs_in(path)]
    if not held_paths and len(fit_paths) > 1:
        held_paths = [fit_paths.pop()]
    urdf = None if model is None else model.urdf
    tolerances = read_tolerances(options.tolerances) if options.tolerances else None
    notes: list[str] = []
    groups: list[list[tuple[ArmRecording, ...]]] = []
    for paths in (fit_paths, held_paths):
        group = []
        for path in paths:
            recordings, more = read_log(path, urdf, tolerances, options.effort)
            group.append(recordings)
            notes += more
        groups.append(group)
    role = options.arm or _moving_role([*groups[0], *groups[1]])
    chosen: list[list[ArmRecording]] = []
    for group in groups:
        one = []
        for recordings in group:
            found = [r for r in recordings if r.arm.role == role]
            if not found:
                roles = [r.arm.role for r in recordings]
                raise InputError(f"{recordings[0].source} has {roles}, not {role}; choose with --arm")
            one.append(found[0])
        if model is not None:
            described = [described_by(r.arm, model) for r in one]
            one = [replace(r, arm=arm) for r, (arm, _) in zip(one, described, strict=True)]
            notes += [note for _, more in described for note in more if note not in notes]
        chosen.append(one)
    fit, held_out = chosen
    for group in (fit, held_out):
        for k, recording in enumerate(group):
            notes += [f"{recording.name}: {note}" for note in check_recording(recording)]
            group[k], note = longest_whole(recording)
            notes += [f"{recording.name}: {note}"] if note else []
    if not held_out:
        (whole,) = fit
        first, last = split(whole)
        fit, held_out = [first], [last]
        notes.append(f"{whole.name} is alone: its last part, after a gap, is held out")
    check_held_out(fit, held_out)
    return fit, held_out, notes


def read_log(
    path: Path, urdf: str | None, tolerances: Tolerances | None, effort: Effort
) -> tuple[tuple[ArmRecording, ...], list[str]]:
    """Arms of one log, a bag with samrl's topics or another tool's, with notes.

    Raises:
        InputError: as `read_foreign` and `load_recordings`.
    """
    from samrl_ros.log_import.foreign import is_foreign, read_foreign
    from samrl_ros.recordings import load_recordings

    if is_foreign(path):
        recording, more = read_foreign(path, urdf, tolerances, effort)
        return (recording,), [f"{path.name}: {note}" for note in more]
    bag = load_recordings(path, urdf=urdf, tolerances=tolerances)
    return bag.recordings, [f"{path.name}: {note}" for role in bag.notes for note in bag.notes[role]]


def _one_log(path: Path, options: DiagnoseOptions) -> tuple[ArmRecording, list[str]]:
    """The arm of a log that moves, or that was chosen."""
    if not is_there(path):
        raise InputError(f"{path} does not exist; give a bag or a log")
    recordings, notes = read_log(path, None, None, options.effort)
    role = options.arm or _moving_role([recordings])
    found = [r for r in recordings if r.arm.role == role]
    if not found:
        raise InputError(f"{path} has {[r.arm.role for r in recordings]}, not {role}; choose with --arm")
    return found[0], notes


def cache_folder() -> Path:
    """Cache of results that only save time: $XDG_CACHE_HOME/samrl, by default ~/.cache/samrl."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "samrl"


def _role_table(index: Path) -> dict[str, list[str]]:
    """File names by role, of an import's recordings.json."""
    table = parse_json(read_text(index, "the recordings' roles"), str(index))
    found = {role: table.get(role, []) for role in ("fit", "held_out")} if isinstance(table, dict) else {}
    names = [name for listed in found.values() if isinstance(listed, list) for name in listed]
    plain = all(isinstance(n, str) and n == Path(n).name and "\0" not in n for n in names)
    if not found or not all(isinstance(listed, list) for listed in found.values()) or not plain:
        raise InputError(
            f"{index} must hold lists of file names under fit and held_out; import again, or name the bags"
        )
    return found


def _roles(bags: Sequence[Path], held_out: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Files to fit and to hold out: as named, by recordings.json of an import, or the last one held out."""
    fit: list[Path] = []
    held = list(held_out)
    for path in bags:
        if not is_there(path):
            raise InputError(f"{path} does not exist; give bags (.mcap), bag folders, or a folder of bags")
        index = path / "recordings.json"
        if path.is_dir() and index.exists():
            table = _role_table(index)
            fit += [path / name for name in table["fit"]]
            if not held_out:
                held += [path / name for name in table["held_out"]]
        elif path.is_dir() and not (path / "metadata.yaml").exists() and any(path.glob("*.mcap")):
            fit += sorted(path.glob("*.mcap"))
        else:
            fit.append(path)
    chosen = {h.resolve() for h in held}
    fit = [f for f in fit if f.resolve() not in chosen]
    if not fit:
        names = ", ".join(sorted(h.name for h in held))
        raise InputError(f"nothing is left to fit: {names} cannot be fitted and held out; give another bag")
    if not held and len(fit) > 1:
        held = [fit.pop()]
    return fit, held


def _moving_role(groups: Sequence[tuple[ArmRecording, ...]]) -> str:
    """The arm that moves in every recording; the tool arm if both do."""
    roles = [{r.arm.role for r in recordings if not no_motion(r)} for recordings in groups]
    common = set.intersection(*roles) if roles else set()
    if not common:
        present = sorted({r.arm.role for recordings in groups for r in recordings})
        raise InputError(f"no arm of {present} moves in every recording; record motion, or choose with --arm")
    return "tool_arm" if "tool_arm" in common else sorted(common)[0]


def _write_resimulation(folder: Path, runs: Sequence) -> None:
    """Held-out channels as measured and as simulated, for evaluation elsewhere; the first recording."""
    if not runs:
        return
    run = runs[0]
    arrays = {"time": run.time}
    names = [n for n in ("nominal", "with_effect", "runner_up") if n in run.simulated]
    for quantity, values in run.measured.items():
        arrays[f"{quantity}_measured"] = values
        for name in names:
            arrays[f"{quantity}_{name}"] = run.simulated[name][quantity]
    write_arrays(folder / "resimulation.npz", arrays)
