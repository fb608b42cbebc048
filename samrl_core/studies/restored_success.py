"""How much success comes back once a diagnosis of the cell's images is put into the cell.

Each cell is a `typical` installation in which one error stands out. Its images are recorded and diagnosed as
a user would, with a plain part on the bench; the same episodes are then run as the cell is described, with
what was diagnosed, and, told by truth, with the error exactly known. Without the error they say what there
was to lose. Two rows do without a diagnosis: all numbers of a correction are fitted to the same images at
once, without asking which of them it is; or nothing is corrected, and what the loop believes of errors is
widened to cover them, which is what randomisation comes to in a loop that is not trained. Nothing is trained,
and no row knows more of the cell than its name says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from samrl_core.cell.calibration.cell_correction import (
    NO_CORRECTION,
    CellCorrection,
    as_data,
    correction_from,
)
from samrl_core.cell.excitation.camera_views import camera_motion
from samrl_core.cell.instance.cell_instance import CellInstance, InstanceName, instance_named
from samrl_core.cell.instance.dominant import DOMINANT
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks import plain_name, task_named
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.world.camera_recording import record_camera
from samrl_core.cell.world.pybullet.world import PyBulletWorld
from samrl_core.cell.world.true_cell import true_cell
from samrl_core.common.figure_file import save_figure
from samrl_core.common.statistics import Share, bootstrap_interval
from samrl_core.common.streams import DEVELOPMENT, TEST, seed_of
from samrl_core.diagnosis.diagnose import diagnose
from samrl_core.diagnosis.export.recalibration import Recalibration
from samrl_core.studies.episodes.world_episodes import EpisodeJob, run_episodes, usual_condition
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress, run_cases
from samrl_core.studies.fit_at_once import fit_at_once
from samrl_core.studies.purpose import keep_purpose, one_purpose

NAME = "restored_success"
COUNT = 12  # cells, each with the next of `DOMINANT`
EPISODES = {"peg_insertion": 2, "peg_insertion_hard": 2}  # in each cell and condition, else one
MAX_ACTIONS = {"peg_insertion": 45}  # where the task's own limit is far beyond an expert's 22 to 41
FIRST_CELL = 400  # and on; of development, or of test where a row is asked for by its name with `_test`
FACTOR = 2.0  # of the error, against what is met in practice where nobody checked
RECORDINGS = (("A", 100), ("B", 101), ("C", 102))  # name and seed of the motion; the last one is held out
SECONDS = 6.0  # each
DOUBT = 4.0  # row DOUBTING: a belief this much wider than in a usual cell covers the errors that stand out
UNHARMED, DESCRIBED, DOUBTING, FITTED = "unharmed", "described", "doubting", "fitted"
DIAGNOSED, TOLD = "diagnosed", "told"
ROWS = {  # what they say of the cell
    UNHARMED: "without the error",
    DESCRIBED: "as it is described",
    DOUBTING: "beliefs widened to cover it",
    FITTED: "all numbers fitted at once",
    DIAGNOSED: "with what was diagnosed",
    TOLD: "with the error told by truth",
}
COLOURS = {
    UNHARMED: "#7a9e7e", DESCRIBED: "#b3261e", DOUBTING: "#8d6ba8", FITTED: "#c98b2b",
    DIAGNOSED: "#1f5fa8", TOLD: "#8a8a8a",
}  # fmt: skip
CORRECTED = (FITTED, DIAGNOSED, TOLD)
CONDITIONS = {f"{row}{end}": (row, of) for of, end in ((DEVELOPMENT, ""), (TEST, "_test")) for row in ROWS}


@dataclass(frozen=True)
class CellJob:
    """One cell to record and to diagnose; what a worker process gets."""

    key: str
    task: str
    cell: str
    instance: str
    error: str  # of `DOMINANT`


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """All cases, the summary, and the picture.

    Raises:
        InputError: rows for development and for a final table in one folder.
    """
    asked = [CONDITIONS[name] for name in options.conditions or ROWS]
    rows, purpose = [row for row, _ in asked], one_purpose(of for _, of in asked)
    keep_purpose(options.out, purpose)
    log = CaseLog(options.out)
    summary: dict[str, Any] = {}
    for task in options.tasks:
        cells = [_cell_job(options, purpose, task, n) for n in range(options.count or COUNT)]
        found: dict[str, Case] = {}
        jobs: list[EpisodeJob] = []
        # The first episode of every cell before any second one, and as many cells at a time as there are
        # processes: a run that time ends has whole cells.
        for k in range(EPISODES.get(task, 1)):
            for first in range(0, len(cells), options.processes):
                some = cells[first : first + options.processes]
                found |= _found(log, some, rows, options, progress)
                now = [_episode(options, c, found[c.key], row, k) for c in some for row in rows]
                run_episodes(log, list({job.key: job for job in now}.values()), options.spread, progress)
                jobs += now
        episodes = [log.cases[job.key] for job in jobs]
        summary[task] = restored(cells, [found[c.key] for c in cells], jobs, episodes)
        draw_restored(summary[task], task, options.out / f"{NAME}_{task}.png")
    return {
        "purpose": purpose,
        "factor": FACTOR,
        "max_actions": {task: _action_limit(task) for task in options.tasks},
        "first_cell": FIRST_CELL,
        "tasks": summary,
    }


def _found(
    log: CaseLog, cells: list[CellJob], rows: list[str], options: Options, progress: Progress
) -> dict[str, Case]:
    """What the rows need to know of some cells, by key."""
    found: dict[str, Case] = {cell.key: {} for cell in cells}
    if {DIAGNOSED, TOLD} & set(rows):
        cases = run_cases(log, examined, [((c.key,), c) for c in cells], options.spread, progress)
        found = {case["key"]: case for case in cases}
    if FITTED in rows:
        fits = [replace(c, key=f"{c.task}/fit/{c.key.rpartition('/')[2]}") for c in cells]
        of_fits = run_cases(log, fitted, [((c.key,), c) for c in fits], options.spread, progress)
        for cell, fit in zip(cells, of_fits, strict=True):
            found[cell.key] = {**found[cell.key], FITTED: fit["correction"]}
    return found


def examined(job: CellJob) -> list[Case]:
    """Record a cell's images as its user would, diagnose them, and keep what a cell can put right of it.

    `told` is truth's, for comparison alone.
    """
    cell, recordings = cell_named(job.cell), record_cell(job)
    instance = instance_named(job.instance, cell)
    found, far = diagnose(recordings[:-1], recordings[-1:])
    corrected = far.correction if isinstance(far.correction, Recalibration) else None
    named = corrected.cell if corrected is not None else NO_CORRECTION
    refused = [f"{r.effect}: {r.says}" for r in corrected.refused] if corrected is not None else []
    first = found.effects[0] if found.effects else found.nearest
    case: Case = {"key": job.key, "task": job.task, "error": job.error, "verdict": found.verdict}
    case["named"] = first.name if first is not None else ""
    case["parameters"] = {
        n: [p.value, *p.ci95] for n, p in (first.parameters.items() if first is not None else ())
    }
    case["reasons"] = list(found.reasons)
    case["not_applied"] = refused
    case["shrink"] = found.gap.shrink if found.gap is not None else None
    applied = named if found.verdict == "effect" else NO_CORRECTION
    return [{**case, DIAGNOSED: as_data(applied), TOLD: as_data(correct_by_truth(job.error, instance, cell))}]


def fitted(job: CellJob) -> list[Case]:
    """The correction that the same images give when all its numbers are fitted at once."""
    return [{"key": job.key, "correction": as_data(fit_at_once(record_cell(job)[:-1]))}]


def record_cell(job: CellJob) -> list[ImageRecording]:
    """Its recordings of the bench that shows its camera and bases; the last one is to be held out."""
    cell = cell_named(job.cell)
    task, instance = bench_of(job.task, cell), instance_named(job.instance, cell)
    loads = nominal_payloads(cell, task.scene(cell).tool)
    recordings = []
    for name, seed in RECORDINGS:
        motion = camera_motion(task, cell, loads, seed, SECONDS)
        world = PyBulletWorld(task, cell, instance=instance)
        try:
            world.reset(0)  # one place of the object, as the recordings of one bench have it
            recordings.append(record_camera(world, task.name, cell, motion, name))
        finally:
            world.close()
    return recordings


def bench_of(name: str, cell: CellSpec) -> Task:
    """The task whose bench a cell is diagnosed on before it does the named one.

    Images tell bases by a held thing whose outline the model knows, beside an object that keeps its shape. A
    thread swings, and the fingers that hold it are known roughly. What is found is the cell's and holds for
    all its tasks, so that one with a thread is diagnosed on the peg's bench, as by a calibration target.

    Raises:
        InputError: there is no such task.
    """
    task = task_named(plain_name(name))
    return task_named("peg_insertion") if task.scene(cell).tool.chain else task


def correct_by_truth(error: str, instance: CellInstance, cell: CellSpec) -> CellCorrection:
    """The correction that truth would make of an error of `DOMINANT`."""
    true = true_cell(cell, instance)
    if error == "hand_eye":
        return CellCorrection(camera_in_flange=true.camera_in_flange)
    if error == "base_to_base":
        bases = true.camera_base_in_world.inverse() @ true.tool_base_in_world
        return CellCorrection(tool_base_in_camera_base=bases)
    depth, optics = instance.depth, instance.optics
    names: dict[str, tuple[tuple[str, ...], np.ndarray]] = {
        "depth_scale": (("depth_scale",), np.array([depth.scale])),
        "depth_offset": (("depth_offset",), np.array([depth.bias])),
        "intrinsics": (("fx", "fy", "cx", "cy"), np.append(optics.focal, optics.centre)),
        "lens_distortion": (("k1", "k2"), optics.radial),
    }
    of_error, values = names[error]
    return CellCorrection(numbers=dict(zip(of_error, values.tolist(), strict=True)))


def restored(
    cells: list[CellJob], found: list[Case], jobs: list[EpisodeJob], episodes: list[Case]
) -> dict[str, Any]:
    """Success by row; and by error, what was said of it. Shares of the loss with bootstrap over cells."""
    by: dict[str, dict[str, list[bool]]] = {}  # success by instance without its error, and row
    for job, case in zip(jobs, episodes, strict=True):
        by.setdefault(job.instance.split()[0], {}).setdefault(job.name, []).append(bool(case["success"]))
    rows = list(dict.fromkeys(job.name for job in jobs))
    all_of = {row: [s for of_cell in by.values() for s in of_cell[row]] for row in rows}
    means = [{row: float(np.mean(of_cell[row])) for row in rows} for of_cell in by.values()]
    out: dict[str, Any] = {
        "cells": len(cells),
        "rows": {row: Share.of(values).as_dict() for row, values in all_of.items()},
        "answers": [
            {
                "instance": job.instance, "verdict": case.get("verdict", ""), "named": case.get("named", ""),
                **{row: sum(by[job.instance.split()[0]][row]) for row in rows},
            }
            for job, case in zip(cells, found, strict=True)
        ],
    }  # fmt: skip
    if {UNHARMED, DESCRIBED} <= set(rows):
        for row in rows:
            if row not in (UNHARMED, DESCRIBED):
                out[f"restored_{row}"] = _share_of_loss(means, row)
    return out


def _share_of_loss(means: list[dict[str, float]], row: str) -> dict[str, Any]:
    """What a row brings back of what the errors cost, over all cells; None where they cost nothing."""

    def share(some: list[dict[str, float]]) -> float:
        lost = sum(m[UNHARMED] - m[DESCRIBED] for m in some)
        return sum(m[row] - m[DESCRIBED] for m in some) / lost if lost > 0 else float("nan")

    value = share(means)
    if not np.isfinite(value):
        return {"value": None, "ci95": None}
    places = list(range(len(means)))

    def of_places(some: Any) -> float:
        return share([means[int(k)] for k in some])

    return {"value": value, "ci95": bootstrap_interval(places, of_places, np.random.default_rng(0))}


def draw_restored(found: dict[str, Any], task: str, path: Path) -> None:
    """Bars of success by row with Wilson intervals, and below, cell by cell, what was said and won."""
    rows, answers = list(found["rows"]), found["answers"]
    size = (9.0, 3.4 + 0.28 * len(answers))
    figure, (upper, lower) = plt.subplots(
        2, 1, figsize=size, layout="constrained", height_ratios=(2.4, 0.6 + 0.28 * len(answers))
    )
    share = 100 * np.array([found["rows"][row]["value"] for row in rows])
    ends = 100 * np.array([found["rows"][row]["ci95"] for row in rows])
    errors = np.clip(np.stack([share - ends[:, 0], ends[:, 1] - share]), 0.0, None)
    places = np.arange(len(rows))
    upper.barh(places, share, xerr=errors, capsize=3, color=[COLOURS[row] for row in rows])
    upper.set_yticks(places, [ROWS[row] for row in rows])
    upper.invert_yaxis()
    trials = found["rows"][rows[0]]["trials"]
    upper.set(xlim=(0, 104), xlabel=f"success by truth [%], 95 % intervals, {trials} episodes a bar")
    upper.set_title(f"{task.replace('_', ' ')}: one error stands out in each of {found['cells']} cells")
    lower.set_axis_off()
    table = [[a["instance"], f"{a['verdict']} {a['named']}", *(str(a[row]) for row in rows)] for a in answers]
    drawn = lower.table(
        cellText=table, colLabels=["cell", "diagnosis", *rows], loc="center", cellLoc="left",
        colWidths=[0.28, 0.42, *(0.3 / len(rows) for _ in rows)],
    )  # fmt: skip
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(7)
    save_figure(figure, path, dpi=110)
    plt.close(figure)


def _cell_job(options: Options, purpose: str, task: str, number: int) -> CellJob:
    cell, error = FIRST_CELL + options.seed + number, list(DOMINANT)[number % len(DOMINANT)]
    instance = str(InstanceName("typical", cell, purpose, ((error, FACTOR),)))
    return CellJob(f"{task}/cell/{cell}", task, options.cell, instance, error)


def _episode(options: Options, cell: CellJob, found: Case, row: str, number: int) -> EpisodeJob:
    """An episode of a row; where nothing was diagnosed, that of the cell as described, under its key."""
    correction = NO_CORRECTION
    if row in CORRECTED:
        correction = correction_from(found[row], cell.key)
    name = cell.instance.split()[0]
    usual = usual_condition(cell.task)
    same = DESCRIBED if row == DIAGNOSED and correction.is_empty else row
    return EpisodeJob(
        key=f"{cell.task}/{same}/{name}/{number}",
        task=cell.task,
        name=row,
        condition=replace(usual, doubt=DOUBT) if row == DOUBTING else usual,
        seed=seed_of(number, "episode", "restored", cell.task, name),
        weights=options.weights,
        cell=cell.cell,
        instance=name if row == UNHARMED else cell.instance,
        correction=correction,
        max_actions=_action_limit(cell.task),
    )


def _action_limit(task: str) -> int:
    return MAX_ACTIONS.get(task) or task_named(task).max_actions


EXPERIMENT = Experiment(
    NAME,
    "success before and after a diagnosis of the cell's images is put into the cell",
    ("peg_insertion_hard",),
    run,
    on_request=("needle_threading_hard", "spatula_flipping_hard", "peg_insertion"),
    conditions=tuple(CONDITIONS),
)
