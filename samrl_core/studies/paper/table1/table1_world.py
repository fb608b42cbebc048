"""Table I in the PyBullet world: success rate of each choice of views, by ground truth.

The paper's table is made inside its model. Here the model is wrong: images are another renderer's and noisy,
contacts another engine's. All conditions act by the learned policy on the same seeds; they differ in views:

- active: Algorithm 1, views by ascent of Q. fixed: the task's start view all the time.
- best_fixed: of reachable views the one that did best in a search on other seeds, held.
- held_random: a reachable view sampled for each episode, held. random: a view sampled before every action.
- optimised, for reference: actions from plans through the model, views by expected information.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import OCCLUDED_TASKS, TASKS, task_named
from samrl_core.studies.episodes.success_rates import compared, rates, write_bars
from samrl_core.studies.episodes.world_episodes import HELD, Condition, EpisodeJob, run_episodes
from samrl_core.studies.experiment import Case, CaseLog, Experiment, Options, Progress
from samrl_core.studies.paper.table1.held_views import HeldView, held_views, ranked_views, spread_views

COUNT = 100  # episodes of active and best_fixed; the others have half as many
BEST = "best_fixed"  # needs a search
LOOKING = {
    "active": Condition(),
    "fixed": Condition(strategy=HELD),
    BEST: Condition(strategy=HELD),
    "held_random": Condition(strategy=HELD),
    "random": Condition(strategy="random", view_period=1),
    "optimised": Condition("optimised", "best"),
}
WHOLE = ("active", BEST)  # conditions with all the episodes


@dataclass(frozen=True)
class SearchSettings:
    """The search for the best fixed view: many views on a few seeds, then the best on more."""

    views: int = 12
    seeds: int = 4
    finalists: int = 4
    final_seeds: int = 12  # those of the first round among them
    first_seed: int = 1_000_000  # apart from those of the episodes


def run(options: Options, progress: Progress, search: SearchSettings | None = None) -> dict[str, Any]:
    """All cases, the summary, and the picture."""
    search = search or SearchSettings()
    log, count = CaseLog(options.out), options.count or COUNT
    views = {task: held_views(task_named(task), cell_named(options.cell)) for task in options.tasks}
    plans = [_Plan(task, views[task], options, search) for task in options.tasks]

    def cases(jobs: Iterable[EpisodeJob]) -> list[Case]:
        return run_episodes(log, list(jobs), options.spread, progress)

    wanted = [name for name in LOOKING if name in (options.conditions or LOOKING)]
    counts = {n: count if n in WHOLE else math.ceil(count / 2) for n in wanted if n != BEST}
    searching = plans if BEST in wanted else []
    first = {plan.task: plan.searched(range(search.seeds), plan.spread) for plan in searching}
    cases([job for jobs in first.values() for job in jobs] + [j for p in plans for j in p.tried(counts)])
    final = {
        plan.task: plan.searched(
            range(search.final_seeds), ranked_views(cases(first[plan.task]))[: search.finalists]
        )
        for plan in searching
    }
    cases(job for jobs in final.values() for job in jobs)
    best = {plan.task: ranked_views(cases(final[plan.task]))[0] for plan in searching}
    jobs = {plan.task: plan.tried(counts) for plan in plans}
    for plan in searching:
        jobs[plan.task] += plan.held(best[plan.task], count)
    cases(job for of_task in jobs.values() for job in of_task)

    summary: dict[str, Any] = {}
    versus: dict[str, Any] = {}
    for task, of_task in jobs.items():
        found = cases(of_task)
        by_name = {n: [c for c in found if c["condition"] == n] for n in wanted}
        summary[task] = {name: rates(some) for name, some in by_name.items()}
        if task in best:
            versus[task] = {n: compared(by_name[n], by_name[BEST]) for n in counts}
    write_bars(summary, "Table I in the PyBullet world", options.out / "table1_world.png")
    return {
        "count": count,
        "tasks": summary,
        "against_best_fixed": versus,
        "best_fixed": {p.task: _view_words(p.views, best[p.task], cases(final[p.task])) for p in searching},
    }


class _Plan:
    """Episodes of one task."""

    def __init__(
        self, task: str, views: tuple[HeldView, ...], options: Options, search: SearchSettings
    ) -> None:
        self.task, self.views, self._options, self._search = task, views, options, search
        self.spread = spread_views(views, search.views)

    def searched(self, seeds: Iterable[int], views: Iterable[int]) -> list[EpisodeJob]:
        """Episodes of the search; its seeds are other ones for every seed of the options."""
        first = self._search.first_seed * (1 + self._options.seed)
        return [self._job("search", first + s, v, f"view{v}/") for v in views for s in seeds]

    def tried(self, counts: dict[str, int]) -> list[EpisodeJob]:
        """Episodes of conditions that need no search."""
        first = self._options.seed
        return [
            self._job(name, first + k, self._sampled(first + k) if name == "held_random" else -1)
            for name, count in counts.items()
            for k in range(count)
        ]

    def held(self, view: int, count: int) -> list[EpisodeJob]:
        """Episodes from the best view of the search."""
        return [self._job(BEST, self._options.seed + k, view) for k in range(count)]

    def _sampled(self, seed: int) -> int:
        return int(np.random.default_rng([seed, 1]).integers(len(self.views)))

    def _job(self, name: str, seed: int, view: int, more: str = "") -> EpisodeJob:
        condition = LOOKING.get(name, LOOKING[BEST])
        stops = self.views[view].way if view >= 0 else ()
        way = tuple(tuple(stop.tolist()) for stop in stops)
        key = f"{self.task}/{name}/{more}{seed}"
        weights, cell = self._options.weights, self._options.cell
        return EpisodeJob(key, self.task, name, condition, seed, view, way, weights=weights, cell=cell)


def _view_words(views: tuple[HeldView, ...], best: int, cases: list[Case]) -> dict[str, Any]:
    """The best view, and what the last round of the search found of each finalist."""
    found = {view: [c for c in cases if c["view"] == view] for view in ranked_views(cases)}
    return {
        "view": best,
        "of": len(views),
        "camera_position": views[best].camera_in_world.position.tolist(),
        "finalists": {str(v): [sum(c["success"] for c in some), len(some)] for v, some in found.items()},
    }


EXPERIMENT = Experiment(
    "table1_world",
    "success in the PyBullet world by the choice of views (Table I), with occluded variants",
    (*TASKS, *OCCLUDED_TASKS),
    run,
    conditions=tuple(LOOKING),
)
