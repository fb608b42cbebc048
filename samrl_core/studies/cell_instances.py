"""Success in cells that differ from their model: by level, by the size of one group of differences, and of
those who do without the loop.

Each instance serves a few episodes, as a cell does. Episodes and instances for development and those for a
final table are drawn from streams of different names, so that they never meet; a folder holds one purpose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from samrl_core.cell.instance.cell_instance import GROUPS, InstanceName
from samrl_core.cell.instance.difference import LEVELS
from samrl_core.cell.tasks import HARD_TASKS, OCCLUDED_TASKS, TASKS
from samrl_core.common.streams import DEVELOPMENT, TEST, seed_of
from samrl_core.studies.episodes.straw_men import STRAW_MEN
from samrl_core.studies.episodes.success_rates import rates, write_bars
from samrl_core.studies.episodes.world_episodes import HELD, Condition, EpisodeJob, run_episodes
from samrl_core.studies.experiment import CaseLog, Experiment, Options, Progress
from samrl_core.studies.purpose import keep_purpose, one_purpose

NAME = "cell_instances"
COUNT = 100  # episodes per condition
PER_INSTANCE = 5  # episodes of one cell
SCALES = (0.5, 2.0, 4.0)  # times typical, one group at a time
THINKING = (0.5, 1.0, 2.0)  # time from an image to its action, where the cell is busy [s]
BY_LEVEL = LEVELS[1:]  # what is run unless something else is asked for
# Who acts otherwise than by the learned policy and views, by what is added to a level's name.
ROWS: dict[str, Condition] = {
    "_optimised": Condition("optimised", "best"),
    "_tip_offset": Condition("optimised", "best", tip_offset=True),
    "_touch": Condition("optimised", "best", tip_offset=True, touch=True),
    "_remembering": Condition("optimised", "best", tip_offset=True, touch=True, remembers=True),
    "_fixed_view": Condition("optimised", HELD),
    **{f"_{name}": Condition("optimised", HELD, straw_man=name) for name in STRAW_MEN},
    **{f"_thinking_{time_s:g}s": Condition(think_s=time_s) for time_s in THINKING},
    "_fixed_view_touch": Condition("optimised", HELD, tip_offset=True, touch=True),
    # Images after the first still tell tip and colours, unlike in one_update_touch.
    "_first_update_touch": Condition("optimised", "best", tip_offset=True, touch=True, most_updates=1),
    # Colours show hole and peg in one image, which replaces the slow calibration: without either, too.
    "_no_offset_touch": Condition("optimised", "best", tip_offset=True, touch=True, sees_tip=False),
    "_no_colours_touch": Condition("optimised", "best", tip_offset=True, touch=True, sees_colours=False),
    "_uncalibrated_touch": Condition(
        "optimised", "best", tip_offset=True, touch=True, sees_tip=False, sees_colours=False
    ),
    **{
        f"_{name}_touch": Condition("optimised", HELD, tip_offset=True, touch=True, straw_man=name)
        for name in ("script", "one_update")
    },
}


@dataclass(frozen=True)
class CellCondition:
    """Which cells a condition is tried in, and who acts there."""

    level: str
    purpose: str = DEVELOPMENT
    scales: tuple[tuple[str, float], ...] = ()
    condition: Condition = Condition()


CONDITIONS: dict[str, CellCondition] = {
    **{
        f"{level}{row}{end}": CellCondition(level, purpose, condition=condition)
        for level in LEVELS
        for row, condition in {"": Condition(), **ROWS}.items()
        for purpose, end in ((DEVELOPMENT, ""), (TEST, "_test"))
        if purpose == DEVELOPMENT or level in BY_LEVEL
    },
    **{
        f"typical_{group}_x{factor:g}": CellCondition("typical", scales=((group, factor),))
        for group in GROUPS
        for factor in SCALES
    },
}


def run(options: Options, progress: Progress) -> dict[str, Any]:
    """All cases, the summary, and the picture.

    Raises:
        InputError: conditions for development and for a final table in one folder.
    """
    names = options.conditions or BY_LEVEL
    purpose = one_purpose(CONDITIONS[name].purpose for name in names)
    keep_purpose(options.out, purpose)
    count = options.count or COUNT
    # Tasks in turn: what is interrupted has something of each.
    jobs = [
        job_of(options, task, name, number)
        for number in range(count)
        for name in names
        for task in options.tasks
    ]
    found = run_episodes(CaseLog(options.out), jobs, options.spread, progress)
    summary = {
        task: {n: rates([c for c in found if (c["task"], c["condition"]) == (task, n)]) for n in names}
        for task in options.tasks
    }
    write_bars(summary, "In cells that differ from their model", options.out / f"{NAME}.png")
    return {"count": count, "per_instance": PER_INSTANCE, "purpose": purpose, "tasks": summary}


def job_of(options: Options, task: str, condition: str, number: int) -> EpisodeJob:
    """The episode of a number; what it starts from is the same in all conditions of a purpose."""
    case = CONDITIONS[condition]
    place = options.seed + number
    instance = InstanceName(case.level, place // PER_INSTANCE, case.purpose, case.scales)
    return EpisodeJob(
        key=f"{task}/{condition}/{place}",
        task=task,
        name=condition,
        condition=case.condition,
        seed=seed_of(place, "episode", case.purpose, task),
        weights=options.weights,
        cell=options.cell,
        instance=str(instance),
    )


EXPERIMENT = Experiment(
    NAME,
    "success in cells that differ from their model, by level, size of one group, and without the loop",
    tuple(TASKS),
    run,
    on_request=(*OCCLUDED_TASKS, *HARD_TASKS),
    conditions=tuple(CONDITIONS),
)
