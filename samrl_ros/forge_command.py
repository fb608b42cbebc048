"""`samrl forge`: make sealed worlds, diagnose them blindly, ask the baselines, and score."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from samrl_core.errors import InputError
from samrl_core.scoring import parallel
from samrl_core.scoring.diagnosis_run import LEFT_OUT_STAGE, STAGE, Job, diagnose_world
from samrl_core.scoring.families import without
from samrl_core.scoring.load import load_outcomes
from samrl_core.scoring.outcome import Outcome
from samrl_core.scoring.study import Study, write_atomically
from samrl_ros.exit_codes import FAILED

forge_app = typer.Typer(
    help="Sealed worlds for a blind test of the diagnosis: make, diagnose, score.", invoke_without_command=True
)
LEFT_OUT_FILE, MAKING_FILE = "left_out.json", "making.json"
VERSIONS = ("samrl", "numpy", "pybullet", "mujoco", "pin", "warp-lang", "torch")

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder that samrl forge made.")]
Workers = Annotated[int, typer.Option(help="Worlds at once.", min=1)]
OnRay = Annotated[bool, typer.Option("--ray", help="Spread over a Ray cluster that sees the same folder.")]


@forge_app.callback()
def forge(
    context: typer.Context,
    out: Annotated[Path | None, typer.Option(help="Folder of the worlds; an unfinished one is resumed.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the worlds.", min=0)] = None,
    commit: Annotated[str | None, typer.Option(help="Commit whose hash gives the seed (HEAD unless given).")] = None,
    worlds: Annotated[int | None, typer.Option(help="Worlds in all, kinds in the usual shares.", min=1)] = None,
    single: Annotated[int | None, typer.Option(help="Worlds with one effect.", min=0)] = None,
    none: Annotated[int | None, typer.Option(help="Worlds without an effect.", min=0)] = None,
    outside: Annotated[int | None, typer.Option(help="Worlds with an effect outside the library.", min=0)] = None,
    double: Annotated[int | None, typer.Option(help="Worlds with two effects.", min=0)] = None,
    mujoco: Annotated[int | None, typer.Option(help="Of all, by MuJoCo instead of PyBullet.", min=0)] = None,
    duration: Annotated[float | None, typer.Option(help="Length of each recording in seconds.")] = None,
    workers: Workers = 2,
    ray: OnRay = False,
) -> None:
    """Make sealed worlds, and publish the hash of their labels."""
    if context.invoked_subcommand is not None:
        return
    if out is None:
        raise typer.BadParameter("--out is missing: the folder of the worlds")
    from samrl_core.forge.plan import ForgeSettings, plan_worlds, seed_from_commit
    from samrl_ros.forge_runs import Making, make

    study = Study(out.resolve())
    chosen = None if seed is not None else (commit or _commit_before(study) or _head())
    counts = {"single": single, "none": none, "outside": outside, "double": double, "mujoco": mujoco}
    given = {name: value for name, value in counts.items() if value is not None}
    if worlds is not None:
        given = _shares(worlds, asdict(ForgeSettings())) | given
    if duration is not None:
        given["duration_s"] = duration  # type: ignore[assignment]
    settings = ForgeSettings(seed=seed if chosen is None else seed_from_commit(chosen), **given)  # type: ignore[arg-type]
    _same_as_before(study, {"settings": asdict(settings), "commit": chosen})
    plan = plan_worlds(settings)
    by_trajectory = sorted(plan, key=lambda item: (item.arm, item.programme, item.engine))  # what a worker keeps
    todo = [Making(study.root, item) for item in by_trajectory if not study.made(item.id)]
    failed: dict[str, str] = {}
    for place in ("obs", "sealed"):
        study.sweep(place)
    for done in _with_progress("worlds", make, todo, len(plan), _mapping(ray, parallel.in_processes), workers):
        if done.error is not None:
            failed[done.item.item.id] = f"{type(done.error).__name__}: {done.error}"
    order = [item.id for item in plan if study.made(item.id)]
    facts = {
        "schema": 1,
        "seed": settings.seed,
        "commit": chosen,
        "settings": asdict(settings),
        "versions": {n: v for n in VERSIONS if (v := _version(n))} | {"python": platform.python_version()},
        "failed": failed,
    }
    console = _console()
    if failed:
        for world, why in failed.items():
            console.print(f"[red]not made[/] {world}: {escape(why)}", soft_wrap=True)
        console.print("[red]nothing is sealed[/] while worlds are missing; the same command tries them again")
        raise typer.Exit(FAILED)
    if not study.forge_file.exists():
        study.seal(order, facts)
    console.print(f"{len(order)} worlds in {study.root}, labels sealed: sha256 {study.published()['sealed_sha256']}")


@forge_app.command()
def diagnose(
    folder: Folder,
    workers: Workers = 2,
    worlds: Annotated[int | None, typer.Option(help="Only the first so many, in their shuffled order.", min=1)] = None,
    leave_one_out: Annotated[
        int, typer.Option("--leave-one-out", help="Also so many single worlds with their family withheld.", min=0)
    ] = 0,
    timeout: Annotated[float, typer.Option(help="Seconds after which a world counts as crashed.")] = 1200.0,
    seed: Annotated[int, typer.Option(help="Seed of every diagnosis.", min=0)] = 0,
    ray: OnRay = False,
) -> None:
    """Diagnose every world in a process without access to the labels; finished worlds are kept."""
    study = Study(folder.resolve())
    listed: list[str] = study.published()["worlds"]
    threads = max(1, (os.cpu_count() or 1) // workers)
    jobs = [
        Job(study.root, world, threads=threads, timeout_s=timeout, seed=seed) for world in listed[: worlds or len(listed)]
    ]
    if leave_one_out:
        for world, family in _left_out(study, leave_one_out).items():
            library = without(family)
            jobs.append(Job(study.root, world, LEFT_OUT_STAGE, library, threads=threads, timeout_s=timeout, seed=seed))
    todo = [job for job in jobs if not job.finished]
    for stage in (STAGE, LEFT_OUT_STAGE):
        study.sweep(stage)
    crashed = 0
    mapping = _mapping(ray, parallel.in_threads)
    for done in _with_progress("diagnoses", diagnose_world, todo, len(jobs), mapping, workers):
        if done.error is not None:
            raise done.error
        crashed += done.result["exit_code"] != 0
    _console().print(f"{len(jobs)} diagnoses, {crashed} of the new ones crashed or were refused; they count as wrong")


@forge_app.command()
def baselines(
    folder: Folder,
    worlds: Annotated[int, typer.Option(help="The first so many, in their shuffled order.", min=1)] = 40,
    only: Annotated[list[str] | None, typer.Option("--only", help="A baseline; repeat for more.")] = None,
    workers: Workers = 2,
    ray: OnRay = False,
) -> None:
    """Ask the baselines about the same recordings."""
    from samrl_core.scoring.baselines.registry import BASELINES, baseline
    from samrl_ros.forge_runs import BaselineJob, ask_baseline

    study = Study(folder.resolve())
    names = only or list(BASELINES)
    for name in names:
        baseline(name)
    jobs = [BaselineJob(study.root, world, name) for name in names for world in study.published()["worlds"][:worlds]]
    todo = [job for job in jobs if not job.finished]
    for name in names:
        study.sweep(f"baselines/{name}")
    for done in _with_progress(
        "baselines", ask_baseline, todo, len(jobs), _mapping(ray, parallel.in_processes), workers
    ):
        if done.error is not None:
            raise done.error


@forge_app.command()
def score(
    folder: Folder,
    out: Annotated[Path | None, typer.Option(help="Where score.json and score.html go (DIR unless given).")] = None,
    unfinished: Annotated[
        bool, typer.Option("--unfinished", help="Worlds without a result count as crashed instead of refusing.")
    ] = False,
    worlds: Annotated[int | None, typer.Option(help="Only the first so many, in their shuffled order.", min=1)] = None,
) -> None:
    """Open the labels, after their hash was checked, and score."""
    from samrl_core.scoring.comparison import comparison
    from samrl_core.scoring.page import figures, score_page
    from samrl_core.scoring.plots import png
    from samrl_core.scoring.scores import all_scores

    study = Study(folder.resolve())
    published, sealed = study.published(), study.open_seal()
    listed = published["worlds"][: worlds or len(published["worlds"])]
    outcomes = load_outcomes(study, sealed, STAGE, listed, unfinished=unfinished)
    left = study.root / LEFT_OUT_FILE
    withheld = list(json.loads(left.read_text())) if left.exists() else []
    left_out = load_outcomes(study, sealed, LEFT_OUT_STAGE, withheld, withheld=True, unfinished=unfinished)
    scores = all_scores(outcomes, left_out, seed=published["seed"] % 2**32)
    scores["baselines"] = rows = comparison(study, sealed, outcomes)
    target = (out or study.root).resolve()
    target.mkdir(parents=True, exist_ok=True)
    facts = {k: v for k, v in published.items() if k != "worlds"}
    content = {"schema": 1, "forge": facts, "scores": scores, "worlds": [_line(o) for o in [*outcomes, *left_out]]}
    write_atomically(target / "score.json", (json.dumps(content, indent=1) + "\n").encode())
    write_atomically(target / "score.html", score_page(scores, outcomes, facts, rows).encode())
    for name, (_, figure) in figures(scores, outcomes).items():
        write_atomically(target / f"score_{name}.png", png(figure))
    _show(scores, rows)
    _console().print(f"[dim]{target / 'score.html'}[/]", soft_wrap=True)


def _show(scores: dict[str, Any], baseline_rows: Sequence[dict[str, Any]]) -> None:
    from samrl_core.scoring.page import share_text
    from samrl_core.scoring.table import score_rows

    console, group = _console(), ""
    table = Table(title="Blind test", title_justify="left", box=None, header_style="bold")
    for name in ("", "score", "value", "95 %", "cases", "aim"):
        table.add_column(name, justify="right" if name in ("value", "95 %", "cases") else "left")
    for row in score_rows(scores):
        colour = "" if row.met is None else ("green" if row.met else "red")
        aim = f"[{colour}]{row.aim}[/]" if colour else row.aim
        table.add_row(row.group if row.group != group else "", row.name, row.value, row.interval, row.cases, aim)
        group = row.group
    console.print(table)
    if baseline_rows:
        compared = Table(title="Baselines, same worlds", title_justify="left", box=None, header_style="bold")
        columns = {"top1_family": "family", "top1_family_place": "family and place", "false_alarms": "false alarms",
                   "unknown_named": "unknown named"}  # fmt: skip
        for name in ("", *columns.values()):
            compared.add_column(name)
        for row in baseline_rows:
            compared.add_row(row["name"], *(share_text(row[c]) for c in columns))
        console.print(compared)


def _line(o: Outcome) -> dict[str, Any]:
    """One world in score.json: what was true, what was said."""
    return {
        "id": o.truth.id,
        "set": o.truth.set,
        "true": o.truth.names,
        "form": o.truth.form,
        "severity": o.truth.severity,
        "engine": o.truth.engine,
        "background_scale": o.truth.background_scale,
        "withheld": o.withheld,
        "verdict": o.verdict,
        "named": [f"{e['family']}@{e['place']}" for e in o.named],
        "candidates": o.candidates[:5],
        "probability": None if o.primary is None else o.primary.get("probability"),
        "shrink": None if o.shrinks is None else o.shrinks.shrink,
        "oracle_shrink": o.shrinks.oracle_shrink if o.shrinks is not None else o.detail.get("oracle_shrink"),
        "unexplained_fraction": None if o.report is None else o.report.get("unexplained_fraction"),
        "seconds": o.seconds,
        "problem": o.detail.get("resimulation") or (o.detail.get("output", "")[-300:] if o.report is None else ""),
    }


def _left_out(study: Study, count: int) -> dict[str, str]:
    """World to withheld family: chosen once from the opened labels, in the shuffled order, family by family.

    This opens the seal inside the harness alone; what a diagnosis gets is a library without that family.
    """
    path = study.root / LEFT_OUT_FILE
    chosen: dict[str, str] = json.loads(path.read_text()) if path.exists() else {}
    labels = study.open_seal().labels()
    waiting = [w for w in study.published()["worlds"] if labels[w]["set"] == "single" and w not in chosen]
    while len(chosen) < count and waiting:
        families = list(chosen.values())
        counts = [families.count(labels[w]["effects"][0]["family"]) for w in waiting]
        world = waiting.pop(counts.index(min(counts)))
        chosen[world] = labels[world]["effects"][0]["family"]
    write_atomically(path, (json.dumps(chosen, indent=1) + "\n").encode())
    return chosen


def _mapping(ray: bool, local: Callable[..., Iterator[parallel.Done]]) -> Callable[..., Iterator[parallel.Done]]:
    return parallel.on_ray if ray else local


def _with_progress(
    what: str,
    work: Callable[[Any], Any],
    todo: Sequence[Any],
    total: int,
    mapping: Callable[..., Iterator[parallel.Done]],
    workers: int,
) -> Iterator[parallel.Done]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    os.environ["SAMRL_FORGE_WORKER"] = "1"  # inherited by the workers alone
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with Progress(*columns, console=_console(stderr=True)) as bar:
        shown = bar.add_task(what, total=total, completed=total - len(todo))
        for done in mapping(work, todo, workers) if todo else ():
            bar.advance(shown)
            yield done


def _same_as_before(study: Study, settings: dict[str, Any]) -> None:
    """A folder belongs to one forge."""
    path = study.root / MAKING_FILE
    text = json.dumps(settings, indent=1) + "\n"
    if path.exists():
        if path.read_text() != text:
            raise InputError(f"{study.root} holds a forge with other settings ({path}); choose another --out")
        return
    if study.root.exists() and any(study.root.iterdir()):
        raise InputError(f"{study.root} is not empty and holds no forge; choose another --out")
    write_atomically(path, text.encode())


def _commit_before(study: Study) -> str | None:
    """The commit that an unfinished forge began with: HEAD may have moved on."""
    path = study.root / MAKING_FILE
    return json.loads(path.read_text())["commit"] if path.exists() else None


def _shares(worlds: int, usual: dict[str, Any]) -> dict[str, int]:
    """Counts of each kind whose sum is `worlds`, in the usual proportions; at least one of each if they fit."""
    kinds = ("single", "none", "outside", "double")
    total = sum(usual[k] for k in kinds)
    counts = {k: max(worlds * usual[k] // total, 1 if worlds >= len(kinds) else 0) for k in kinds}
    counts["single"] += worlds - sum(counts.values())
    return counts | {"mujoco": round(worlds * usual["mujoco"] / total)}


def _head() -> str:
    """Hash of the commit that is tested."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError("this is no git checkout, so there is no commit to seed from; give --seed or --commit") from error
    return found.stdout.strip()


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _console(stderr: bool = False) -> Console:
    tty = (sys.stderr if stderr else sys.stdout).isatty()
    return Console(stderr=stderr, width=None if tty else 150, highlight=False)
