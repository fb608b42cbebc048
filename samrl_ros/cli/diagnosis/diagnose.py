"""`samrl diagnose`: recordings in; report.json, report.html and ten lines in the terminal out."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from samrl_core.cell.types.body_recording import BodyRecording
from samrl_core.common.array_file import write_arrays
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.export.correction import Correction
from samrl_core.diagnosis.result import GAPS
from samrl_ros.cli.diagnosis.library import read_library
from samrl_ros.cli.diagnosis.load import load, load_one
from samrl_ros.cli.diagnosis.notes import together
from samrl_ros.cli.diagnosis.options import DiagnoseOptions
from samrl_ros.contract.exit_codes import GAP_FOUND, INTERRUPTED, OK
from samrl_ros.contract.interrupts import held_back


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
    _refuse_idle(options)
    if options.many is not None:
        return _many(options)
    if options.watch:
        return _watch(options)
    if not options.bags and options.mapping is None:
        raise InputError("no recording is named; give bags, a folder of bags or a log, or --many DIR")
    screen = Console()
    if options.sim is not None:
        if options.mapping is not None:
            raise InputError("--sim compares bags; `samrl bag import` makes them of logs with a mapping")
        if len(options.bags) != 1:
            raise InputError(f"--sim compares one log with another; {len(options.bags)} logs were given")
        compare(options.bags[0], options.sim, options.out, lambda path: load_one(path, options), screen)
        return OK
    if is_report(options.bags):
        model = model_of(options.urdf, options.xacro_arg) if options.urdf else None
        export_report(options.bags[0], model, options.export, options.randomise, screen)
        return OK
    if (options.out / "report.json").exists():
        raise InputError(f"{options.out} has a report already; give another --out, reports are not replaced")
    from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
    from samrl_core.diagnosis.findings.tracking import checked_names
    from samrl_core.diagnosis.report.terminal import summary, tracked
    from samrl_core.diagnosis.report.write_report import report_contents, write_contents
    from samrl_core.diagnosis.selection.settings import SelectionSettings

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
    began, correction = time.monotonic(), None
    try:
        with screen.status("reading recordings") as status:
            model = model_of(options.urdf, options.xacro_arg) if options.urdf else None
            fit, held_out, notes = load(options, model)
            if options.apply and any(isinstance(r, BodyRecording) for r in fit):
                raise InputError("--apply is for arms, poses, readings, images; of a body read report.json")
            for note in together(notes):
                screen.print(f"[yellow]note:[/] {escape(note)}", highlight=False, soft_wrap=True)
            diagnosis, far = diagnose(fit, held_out, settings, notes, status.update)
            status.update("writing the report")
            contents, made = report_contents(diagnosis), far.correction
        with held_back() as heard:  # what is known by now is written whole
            _write_resimulation(options.out, far.resimulations)
            if isinstance(made, Correction):
                correction = keep_correction(made, model, options.out)
            files = write_contents(contents, options.out)
            applied = apply(made, diagnosis, options.out) if options.apply else []
    except KeyboardInterrupt:
        lost = f"interrupted: {time.monotonic() - began:.0f} s of work are lost, nothing was written"
        screen.print(f"{lost}; the same command begins anew", highlight=False, soft_wrap=True)
        return INTERRUPTED
    for line in (*summary(diagnosis, [str(f) for f in files]), *tracked(diagnosis)):
        screen.print(escape(line), highlight=False, soft_wrap=True)
    for line in applied:
        screen.print(escape(line), highlight=False, soft_wrap=True)
    if heard.any:
        screen.print("interrupted when the report was written already: it is whole", highlight=False)
        return INTERRUPTED
    if options.export and correction is None:
        screen.print(f"nothing was named, so there is nothing to export to {', '.join(options.export)}")
    elif correction is not None:
        export_all(correction, options.export, options.out, options.randomise, screen)
    return GAP_FOUND if options.fail_on_gap and diagnosis.verdict in GAPS else OK


def _refuse_idle(options: DiagnoseOptions) -> None:
    """Refuse options that would do nothing beside the others. Raises `InputError`."""
    usual = DiagnoseOptions()

    def given(*names: str) -> list[str]:
        return [f"--{n.replace('_', '-')}" for n in names if getattr(options, n) != getattr(usual, n)]

    for wanted, there, idle in (
        ("--mapping FILE", options.mapping is not None, given("data")),
        ("--export TARGET", bool(options.export), given("randomise")),
        ("--watch", options.watch, given("window", "windows", "keep")),
        ("--many DIR", options.many is not None, given("workers", "ray")),
        ("--camera", options.camera, given("scene")),
    ):
        if idle and not there:
            raise InputError(
                f"without {wanted} nothing comes of {', '.join(idle)}; give that too, or leave it out"
            )
    if options.many is not None and (other := given("camera", "apply", "sim", "watch")):
        raise InputError(f"--many diagnoses joints' recordings one by one; leave out {', '.join(other)}")


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

    if (
        options.bags or options.held_out or options.sim is not None or options.apply or options.export
        or options.mapping is not None or options.camera
    ):  # fmt: skip
        raise InputError(
            "--watch takes its recordings from the running graph; leave out bags, --mapping, --camera,"
            " --held-out, --sim, --apply and --export, and diagnose a kept window with them later"
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
    for name in ("urdf", "tolerances", "library", "mapping", "data"):
        if (path := getattr(options, name)) is not None:
            shared += [f"--{name}", str(path.resolve())]
    shared += ["--arm", options.arm] if options.arm else []
    for name, values in (
        ("--xacro-arg", options.xacro_arg), ("--track", options.track), ("--export", options.export),
    ):  # fmt: skip
        shared += [text for value in values for text in (name, value)]
    return shared


def cache_folder() -> Path:
    """Cache of results that only save time: $XDG_CACHE_HOME/samrl, by default ~/.cache/samrl."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "samrl"


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
