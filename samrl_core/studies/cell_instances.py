"""Success in cells that differ from their model: by level, and by the size of one group of differences.

Each instance serves a few episodes, as a cell does. Episodes and instances for development and those for a
final table are drawn from streams of different names, so that they never meet.
"""

from __future__ import annotations

from typing import Any

from samrl_core.cell.instance.cell_instance import GROUPS, InstanceName
from samrl_core.cell.instance.difference import LEVELS
from samrl_core.cell.tasks import OCCLUDED_TASKS, TASKS
from samrl_core.common.streams import DEVELOPMENT, TEST, seed_of
from samrl_core.studies.episodes.success_rates import rates, write_bars
from samrl_core.studies.episodes.world_episodes import Condition, EpisodeJob, run_episodes
from samrl_core.studies.experiment import CaseLog, Experiment, Options, Progress

NAME = "cell_instances"
COUNT = 100  # episodes per condition
PER_INSTANCE = 5  # episodes of one cell
SCALES = (0.5, 2.0, 4.0)  # times typical, one group at a time
BY_LEVEL = LEVELS[1:]  # what is run unless something else is asked for
# By name: level, purpose and scales.
CONDITIONS: dict[str, tuple[str, str, tuple[tuple[str, float], ...]]] = {
    **{level: (level, DEVELOPMENT, ()) for level in LEVELS},
    **{f"{level}_test": (level, TEST, ()) for level in BY_LEVEL},
    **{
        f"typical_{group}_x{factor:g}": ("typical", DEVELOPMENT, ((group, factor),))
        for group in GROUPS
        for factor in SCALES
    },
}


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """All cases, the summary, and the picture."""
    names = options.conditions or BY_LEVEL
    count = options.count or COUNT
    # Tasks in turn: what is interrupted has something of each.
    jobs = [
        job_of(options, task, name, number)
        for number in range(count)
        for name in names
        for task in options.tasks
    ]
    found = run_episodes(CaseLog(options.out), jobs, options.processes, progress)
    summary = {
        task: {n: rates([c for c in found if (c["task"], c["condition"]) == (task, n)]) for n in names}
        for task in options.tasks
    }
    write_bars(summary, "In cells that differ from their model", options.out / f"{NAME}.png")
    return {"count": count, "per_instance": PER_INSTANCE, "tasks": summary}


def job_of(options: Options, task: str, condition: str, number: int) -> EpisodeJob:
    """The episode of a number; what it starts from is the same in all conditions of a purpose."""
    level, purpose, scales = CONDITIONS[condition]
    place = options.seed + number
    instance = InstanceName(level, place // PER_INSTANCE, purpose, scales)
    return EpisodeJob(
        key=f"{task}/{condition}/{place}",
        task=task,
        name=condition,
        condition=Condition(),
        seed=seed_of(place, "episode", purpose, task),
        weights=options.weights,
        cell=options.cell,
        instance=str(instance),
    )


EXPERIMENT = Experiment(
    NAME,
    "success in cells that differ from their model, by level and by size of one group of differences",
    tuple(TASKS),
    run,
    on_request=tuple(OCCLUDED_TASKS),
    conditions=tuple(CONDITIONS),
)
