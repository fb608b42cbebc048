"""What updating and the residual are worth where the world differs from the model (the paper's Fig. 8d).

Algorithm 1 with its learned parts in `differing_world`, and the same without Real2Sim's updates, without the
residual, and without both, on the same seeds. The residual is `<task>_residual_actor.safetensors` beside
actor and Q, and the calibration is off as it was where that one was trained. Of a task that has none, the
two conditions without it are shown.
"""

from __future__ import annotations

from typing import Any

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import TASKS
from samrl_core.common.errors import InputError
from samrl_core.policy.networks.weights import load_weights, sha256_of, weights_file
from samrl_core.studies.episodes.differing_world import trained_offset
from samrl_core.studies.episodes.success_rates import compared, rates, write_bars
from samrl_core.studies.episodes.world_episodes import Condition, EpisodeJob, run_episodes
from samrl_core.studies.experiment import CaseLog, Experiment, Options, Progress

COUNT = 50  # episodes per condition
ABLATIONS = {
    "full": Condition(residual=True),
    "without_updating": Condition(update=False, residual=True),
    "without_residual": Condition(),
    "without_both": Condition(update=False),
}


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """All cases, the summary, and the picture."""
    jobs = {task: episodes_of(task, options) for task in options.tasks}
    together = [job for of_task in jobs.values() for job in of_task]
    found = run_episodes(CaseLog(options.out), together, options.spread, progress)
    summary: dict[str, Any] = {}
    versus: dict[str, Any] = {}
    for task, of_task in jobs.items():
        names = list(dict.fromkeys(job.name for job in of_task))
        by_name = {n: [c for c in found if (c["task"], c["condition"]) == (task, n)] for n in names}
        summary[task] = {name: rates(some) for name, some in by_name.items()}
        versus[task] = {n: compared(by_name[names[0]], by_name[n]) for n in names[1:]}
    write_bars(summary, "In a world that differs from the model", options.out / "fig8d.png")
    residuals = {task: of_task[0].residual for task, of_task in jobs.items()}
    return {
        "count": options.count or COUNT,
        "tasks": summary,
        "first_against": versus,
        "offset": {task: of_task[0].offset for task, of_task in jobs.items()},
        "residual_sha256": {task: sha256_of(file) if file else "" for task, file in residuals.items()},
    }


def episodes_of(task: str, options: Options) -> list[EpisodeJob]:
    """Episodes of a task, condition by condition; those with a residual only where there is one.

    Raises:
        InputError: the residual's file does not fit, see `load_weights`, or a condition that was asked for
            needs one and there is none.
    """
    file = weights_file(task, "residual_actor", options.weights)
    residual = file if file.is_file() else None
    offset = (0.0, 0.0, 0.0)
    if residual is not None:
        _, info = load_weights(residual, "residual_actor", task, cell_named(options.cell))
        offset = trained_offset(info.figures)
    possible = {n: c for n, c in ABLATIONS.items() if residual is not None or not c.residual}
    missing = [name for name in options.conditions if name not in possible]
    if missing:
        raise InputError(f"{missing[0]} of {task} needs {file}, which is not there; ask for other conditions")
    if options.conditions:
        possible = {name: c for name, c in possible.items() if name in options.conditions}
    return [
        EpisodeJob(
            key=f"{task}/{name}/{seed}",
            task=task,
            name=name,
            condition=condition,
            seed=seed,
            differs=True,
            offset=offset,
            weights=options.weights,
            cell=options.cell,
            residual=residual,
        )
        for name, condition in possible.items()
        for seed in range(options.seed, options.seed + (options.count or COUNT))
    ]


EXPERIMENT = Experiment(
    "fig8d",
    "ablations in a world that differs from the model",
    tuple(TASKS),
    run,
    conditions=tuple(ABLATIONS),
)
