"""`samrl forge`: make sealed worlds, diagnose them blindly, ask the baselines, and score."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from samrl_core.blind_test.scores.diagnosis_run import LEFT_OUT_STAGE, STAGE, DiagnosisJob, diagnose_world
from samrl_core.blind_test.scores.study import SETS, Study
from samrl_core.common import executor
from samrl_core.common.files import write_whole
from samrl_ros.blind_test.study import (
    KINDS,
    LEFT_OUT_FILE,
    commit_before,
    commit_or_none,
    head,
    left_out,
    same_as_before,
)
from samrl_ros.cli.blind_test.making import make_and_seal, mapping_of, name_failed
from samrl_ros.cli.blind_test.show import console as make_console
from samrl_ros.cli.blind_test.show import line, show
from samrl_ros.cli.progress import SIDE_BY_SIDE, with_progress

forge_app = typer.Typer(
    help="Sealed worlds for a blind test of the diagnosis: make, diagnose, score.",
    invoke_without_command=True,
)

Out = Annotated[Path, typer.Option(help="Folder of the worlds; an unfinished one is resumed.")]
Seed = Annotated[int | None, typer.Option(help="Seed of the worlds.", min=0)]
Commit = Annotated[str | None, typer.Option(help="Commit whose hash gives the seed (HEAD unless given).")]
Single = Annotated[int | None, typer.Option(help="Worlds with one effect.", min=0)]
Without = Annotated[int | None, typer.Option(help="Worlds without an effect.", min=0)]
Outside = Annotated[int | None, typer.Option(help="Worlds with an effect outside the library.", min=0)]
Double = Annotated[int | None, typer.Option(help="Worlds with two effects.", min=0)]
Duration = Annotated[float | None, typer.Option(help="Length of each recording in seconds.")]
StatedFriction = Annotated[
    bool,
    typer.Option("--stated-friction", help="Models state friction, machines stick, logs miss rows."),
]
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder that samrl forge made.")]
Workers = Annotated[int, typer.Option(help="Worlds at once.", min=1)]
OnRay = Annotated[bool, typer.Option("--ray", help="Spread over a Ray cluster that sees the same folder.")]


@forge_app.callback()
def forge(
    context: typer.Context,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the worlds; an unfinished one is resumed.")
    ] = None,
    seed: Seed = None,
    commit: Commit = None,
    worlds: Annotated[
        int | None, typer.Option(help="Worlds in all, kinds in the usual shares.", min=1)
    ] = None,
    single: Single = None,
    none: Without = None,
    outside: Outside = None,
    double: Double = None,
    mujoco: Annotated[
        int | None, typer.Option(help="Of all, by MuJoCo instead of PyBullet; else the usual share.", min=0)
    ] = None,
    pinocchio: Annotated[
        int | None, typer.Option(help="Of all, by Pinocchio; else the usual share.", min=0)
    ] = None,
    second_set: Annotated[
        bool,
        typer.Option(
            "--second-set/--no-second-set",
            help="Half of the effects by the set of disturbances that was written anew.",
        ),
    ] = True,
    family: Annotated[
        list[str] | None,
        typer.Option("--family", "--effect", help="Only this family of effects; may be repeated."),
    ] = None,
    duration: Duration = None,
    stated_friction: StatedFriction = False,
    workers: Workers = SIDE_BY_SIDE,
    ray: OnRay = False,
) -> None:
    """Make sealed worlds, and publish the hash of their labels."""
    if context.invoked_subcommand is not None:
        return
    if out is None:
        raise typer.BadParameter("--out is missing: the folder of the worlds")
    from samrl_core.blind_test.engines.simulate import DivergedError
    from samrl_core.blind_test.worlds.plan import plan_worlds
    from samrl_ros.blind_test.asked_study import AskedStudy
    from samrl_ros.blind_test.runs import Making, make

    study = Study(out.resolve())
    chosen, number = _seed_of(study, seed, commit)
    asked = AskedStudy(
        worlds,
        {"single": single, "none": none, "outside": outside, "double": double},
        {"mujoco": mujoco, "pinocchio": pinocchio},
        second_set,
        tuple(family or ()),
        duration,
        stated_friction,
    )
    settings = asked.settings(study, number)
    same_as_before(study, {"settings": settings.as_dict(), "commit": chosen})
    plan = plan_worlds(settings)
    console = make_console()
    listed = ", ".join(f"{getattr(settings, kind)} {kind}" for kind in KINDS)
    engines = f"{settings.mujoco} of all by MuJoCo, {settings.pinocchio} by Pinocchio"
    console.print(f"{len(plan)} worlds: {listed}; {engines}", soft_wrap=True)
    by_trajectory = sorted(
        plan, key=lambda item: (item.arm, item.programme, item.engine)
    )  # what a worker keeps
    todo = [Making(study.root, item) for item in by_trajectory if not study.made(item.id)]
    facts = {"commit": chosen, "settings": _published(settings.as_dict())}
    make_and_seal(study, [item.id for item in plan], make, todo, facts, DivergedError, workers, ray)


@forge_app.command()
def servos(
    out: Out,
    seed: Seed = None,
    commit: Commit = None,
    single: Single = None,
    none: Without = None,
    outside: Outside = None,
    double: Double = None,
    duration: Duration = None,
    stated_friction: StatedFriction = False,
    workers: Workers = SIDE_BY_SIDE,
    ray: OnRay = False,
) -> None:
    """Make sealed worlds of servo machines of one to three axes, as users' logs with mappings."""
    from samrl_core.blind_test.servo_worlds.engine import RanAwayError
    from samrl_core.blind_test.servo_worlds.plan import ServoSettings, plan_servos
    from samrl_ros.blind_test.servo_runs import ServoMaking, make_servo

    study = Study(out.resolve())
    chosen, number = _seed_of(study, seed, commit)
    asked = {"single": single, "none": none, "outside": outside, "double": double, "duration_s": duration}
    settings = ServoSettings(
        seed=number,
        stated_friction=stated_friction,
        **{name: value for name, value in asked.items() if value is not None},  # ty: ignore[invalid-argument-type]
    )
    same_as_before(study, {"settings": settings.as_dict(), "commit": chosen})
    plan = plan_servos(settings)
    make_console().print(f"{len(plan)} worlds of servo machines", soft_wrap=True)
    todo = [ServoMaking(study.root, item) for item in plan if not study.made(item.id)]
    facts = {"commit": chosen, "settings": _published(settings.as_dict()), "servo_worlds": True}
    make_and_seal(study, [item.id for item in plan], make_servo, todo, facts, RanAwayError, workers, ray)


@forge_app.command()
def cameras(
    out: Out,
    seed: Seed = None,
    commit: Commit = None,
    single: Annotated[int | None, typer.Option(help="Worlds with one known cause.", min=0)] = None,
    none: Annotated[int | None, typer.Option(help="Worlds without a cause.", min=0)] = None,
    outside: Annotated[
        int | None, typer.Option(help="Worlds with a cause outside the library.", min=0)
    ] = None,
    cause: Annotated[
        list[str] | None, typer.Option(help="A known cause to choose from; may be repeated.")
    ] = None,
    duration: Duration = None,
    workers: Workers = SIDE_BY_SIDE,
    ray: OnRay = False,
) -> None:
    """Make sealed typical cells with one cause in front of or behind the camera, as bags of images."""
    from samrl_core.blind_test.camera_worlds.forge_plan import CameraForgeSettings, plan_cameras
    from samrl_core.blind_test.engines.simulate import DivergedError
    from samrl_ros.blind_test.camera_runs import PARTS, CameraMaking, make_camera

    study = Study(out.resolve())
    chosen, number = _seed_of(study, seed, commit)
    asked = {"single": single, "none": none, "outside": outside, "duration_s": duration}
    settings = CameraForgeSettings(
        seed=number,
        causes=tuple(cause or ()),
        **{name: value for name, value in asked.items() if value is not None},  # ty: ignore[invalid-argument-type]
    )
    same_as_before(study, {"settings": asdict(settings), "commit": chosen})
    plan = plan_cameras(settings)
    make_console().print(f"{len(plan)} worlds of a camera", soft_wrap=True)
    todo = [CameraMaking(study.root, item) for item in plan if not study.made(item.id)]
    facts = {
        "commit": chosen, "settings": _published(asdict(settings)), "parts": list(PARTS),
        "arguments": ["--camera", "--scene", "peg_insertion"],
    }  # fmt: skip
    make_and_seal(study, [item.id for item in plan], make_camera, todo, facts, DivergedError, workers, ray)


def _seed_of(study: Study, seed: int | None, commit: str | None) -> tuple[str | None, int]:
    """Commit that gives the seed, None where the seed is given; and the seed."""
    from samrl_core.blind_test.worlds.plan import seed_from_commit

    if seed is not None:
        return None, seed
    chosen = commit or commit_before(study) or head()
    return chosen, seed_from_commit(chosen)


def _published(settings: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if name != "seed"}


@forge_app.command()
def diagnose(
    folder: Folder,
    workers: Workers = SIDE_BY_SIDE,
    worlds: Annotated[
        int | None, typer.Option(help="Only the first so many, in their shuffled order.", min=1)
    ] = None,
    leave_one_out: Annotated[
        int,
        typer.Option("--leave-one-out", help="Also so many single worlds with their family withheld.", min=0),
    ] = 0,
    timeout: Annotated[float, typer.Option(help="Seconds after which a world counts as crashed.")] = 1200.0,
    seed: Annotated[int, typer.Option(help="Seed of every diagnosis.", min=0)] = 0,
    again: Annotated[bool, typer.Option("--again", help="Do anew what crashed or was refused.")] = False,
    ray: OnRay = False,
) -> None:
    """Diagnose every world in a process without access to the labels; finished worlds are not run again."""
    study = Study(folder.resolve())
    published = study.published()
    listed: list[str] = published["worlds"]
    every = DiagnosisJob(
        study.root,
        world="",
        threads=max(1, (os.cpu_count() or 1) // workers),
        timeout_s=timeout,
        seed=seed,
        commit=commit_or_none(),
        parts=tuple(published.get("parts", SETS)),
        arguments=tuple(published.get("arguments", ())),
    )
    jobs = [replace(every, world=world) for world in listed[: worlds or len(listed)]]
    if leave_one_out:
        from samrl_core.blind_test.scores.families import without  # loads torch

        for world, family in left_out(study, leave_one_out).items():
            jobs.append(replace(every, world=world, stage=LEFT_OUT_STAGE, library=without(family)))
    todo = [job for job in jobs if not job.finished or (again and job.crashed)]
    for stage in (STAGE, LEFT_OUT_STAGE):
        study.sweep(stage)
    crashed, failed = 0, {}
    mapping = mapping_of(ray, executor.run_in_threads)
    for done in with_progress("diagnoses", diagnose_world, todo, len(jobs), mapping, workers):
        if isinstance(done.error, InterruptedError):
            raise done.error
        if done.error is not None:
            failed[f"{done.item.stage}/{done.item.world}"] = f"{type(done.error).__name__}: {done.error}"
            continue
        crashed += done.result["exit_code"] != 0
    make_console().print(
        f"{len(jobs)} diagnoses, {crashed} of the new ones crashed or were refused; they count as wrong"
    )
    name_failed("not run", failed)


@forge_app.command()
def baselines(
    folder: Folder,
    worlds: Annotated[int, typer.Option(help="The first so many, in their shuffled order.", min=1)] = 40,
    only: Annotated[list[str] | None, typer.Option("--only", help="A baseline; repeat for more.")] = None,
    workers: Workers = SIDE_BY_SIDE,
    ray: OnRay = False,
) -> None:
    """Ask the baselines about the same recordings."""
    from samrl_core.blind_test.baselines.registry import BASELINES, baseline
    from samrl_ros.blind_test.runs import BaselineJob, ask_baseline

    study = Study(folder.resolve())
    names = only or list(BASELINES)
    for name in names:
        baseline(name)
    jobs = [
        BaselineJob(study.root, world, name)
        for name in names
        for world in study.published()["worlds"][:worlds]
    ]
    todo = [job for job in jobs if not job.finished]
    for name in names:
        study.sweep(f"baselines/{name}")
    failed: dict[str, str] = {}
    for done in with_progress(
        "baselines", ask_baseline, todo, len(jobs), mapping_of(ray, executor.run_in_processes), workers
    ):
        if done.error is not None:
            failed[f"{done.item.name}/{done.item.world}"] = f"{type(done.error).__name__}: {done.error}"
    name_failed("not asked", failed)


@forge_app.command()
def score(
    folder: Folder,
    out: Annotated[
        Path | None, typer.Option(help="Where score.json and score.html go (DIR unless given).")
    ] = None,
    unfinished: Annotated[
        bool,
        typer.Option("--unfinished", help="Worlds without a result count as crashed instead of refusing."),
    ] = False,
    worlds: Annotated[
        int | None, typer.Option(help="Only the first so many, in their shuffled order.", min=1)
    ] = None,
) -> None:
    """Open the labels, after their hash was checked, and score."""
    from samrl_core.blind_test.scores.comparison import comparison
    from samrl_core.blind_test.scores.load import load_outcomes
    from samrl_core.blind_test.scores.page import make_figures, score_page
    from samrl_core.blind_test.scores.plots import png
    from samrl_core.blind_test.scores.scores import all_scores

    study = Study(folder.resolve())
    published, sealed = study.published(), study.open_seal()
    listed = published["worlds"][: worlds or len(published["worlds"])]
    outcomes = load_outcomes(study, sealed, STAGE, listed, unfinished=unfinished)
    left = study.root / LEFT_OUT_FILE
    withheld = list(json.loads(left.read_text())) if left.exists() else []
    unknown = load_outcomes(study, sealed, LEFT_OUT_STAGE, withheld, withheld=True, unfinished=unfinished)
    scores = all_scores(outcomes, unknown)
    scores["baselines"] = rows = comparison(study, sealed, outcomes)
    target = (out or study.root).resolve()
    target.mkdir(parents=True, exist_ok=True)
    facts = {k: v for k, v in published.items() if k != "worlds"}
    content = {
        "schema": 1,
        "forge": facts,
        "scores": scores,
        "worlds": [line(o) for o in [*outcomes, *unknown]],
    }
    write_whole(target / "score.json", json.dumps(content, indent=1) + "\n")
    write_whole(target / "score.html", score_page(scores, outcomes, facts, rows))
    for name, (_, figure) in make_figures(scores, outcomes).items():
        write_whole(target / f"score_{name}.png", png(figure))
    show(scores, rows)
    make_console().print(f"[dim]{target / 'score.html'}[/]", soft_wrap=True)
